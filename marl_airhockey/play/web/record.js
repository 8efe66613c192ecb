// One's own record, which this browser stores: games by level, and the best of a task today.

const today = () => new Date().toISOString().slice(0, 10);
function read(key) { try { return JSON.parse(localStorage.getItem(key)) || {}; } catch { return {}; } }
function write(key, value) { try { localStorage.setItem(key, JSON.stringify(value)); } catch { /* a full or forbidden store */ } }

const gamesKey = (scenario) => `record ${scenario}`;
export function recordOf(scenario, level) { return { won: 0, drawn: 0, lost: 0, ...read(gamesKey(scenario))[level] }; }
export function noteGame(scenario, level, result) {
  const all = read(gamesKey(scenario)), row = recordOf(scenario, level);
  row[result] += 1;
  write(gamesKey(scenario), { ...all, [level]: row });
}

export function bestToday(scenario) { const row = read(`best ${scenario}`); return row.day === today() ? row.count : null; }
export function noteTries(scenario, count) {
  if (count > (bestToday(scenario) ?? -1)) write(`best ${scenario}`, { day: today(), count });
}
