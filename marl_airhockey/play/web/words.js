"use strict";
// Text and controls around the table.

const put = (node, text) => { if (node.textContent !== text) node.textContent = text; };
let deed = "start"; // kind of the message that the button of the notice sends
function show(headline, detail, go, bare = false, sends = "start") {
  $("notice").hidden = false; $("notice").classList.toggle("bare", bare);
  put($("headline"), headline); put($("detail"), detail); $("go").hidden = !go; put($("go"), go);
  deed = sends;
}

function updateWords() {
  const game = match.scenario.replaceAll("_", " ");
  put($("site"), "Air hockey: ");
  put($("game"), `${game}${now.golden_goal ? ", the next goal wins" : ""}`);
  if (document.title !== `Air hockey: ${game}`) document.title = `Air hockey: ${game}`;
  scoreboard();
  updateRealTable();
  put($("clock"), `${Math.max(0, match.seconds - now.time).toFixed(0)} s`);
  put($("trip"), roundTrip === null ? "" : `round trip ${roundTrip.toFixed(0)} ms`);
  put($("rate"), `loop ${now.rate.toFixed(1)} Hz`);
  put($("watching"), now.watching ? `${now.watching} watching` : "");
  put($("drivers"), now.seats.map((s) => s.driver).join(", "));
  const slow = linkRate() < 60 && performance.now() - openedAt > 3000;
  const late = slow && now.link.ms > 50 ? `, ${(now.link.ms / 1000).toFixed(1)} s delay` : "";
  put($("link"), slow ? `slow link: ${linkRate()} frames per second${late}` : "");
  $("recording").hidden = !now.recording && !now.not_recorded;
  put($("recording"), now.not_recorded ? `not recorded: ${now.not_recorded}` : "● recording");
  if (recording) { updateReplayWords(); return; }
  if (match.study) { updateStudyWords(); return; }
  const runs = ["play", "countdown", "arrange"].includes(now.phase), sits = now.seat !== null;
  const free = now.seats.findIndex((s) => s.driver === "person" && !s.taken);
  const mayControl = (sits || now.seats.every((s) => s.driver !== "person")) && free < 0;
  put($("pause"), runs ? (match.camera ? "Stop" : "Pause") : "Start"); $("pause").disabled = !mayControl;
  $("swap").hidden = now.seats.length < 2; $("swap").disabled = runs || now.phase === "pause" || !mayControl;
  $("leave").hidden = !sits;
  canvas.classList.toggle("mine", sits && now.phase === "play");
  seats(free);
  notice(sits, free, mayControl);
}

function updateReplayWords() {
  const over = now.phase === "done";
  put($("pause"), recording.runs ? "Pause" : "Play");
  seats(-1);
  if (over) show(verdict(), why(), "");
  else if (flash > 0.3) show("Goal!", "", "", true);
  else $("notice").hidden = true;
}

function notice(sits, free, mayControl) {
  const alone = sits && free >= 0 && !match.camera && !match.study; // others have left
  $("stop").hidden = Boolean(match.study) || now.phase !== "pause" || !(mayControl || alone);
  $("golden").hidden = Boolean(match.study) || !now.offers_golden_goal || !mayControl;
  if (down) show("No connection", refused || "trying again…", "");
  else if (now.phase === "arrange") show("Getting ready", now.reason, "");
  else if (now.phase === "countdown") show(String(Math.ceil(now.time_left)), "", "", true);
  else if (now.phase === "lobby") show(sits ? "Ready?" : "Watching", sits && free >= 0 ? "Waiting for another player, who has to open this page." : sits ? `${match.what} ${howTo()}` : now.queue === 1 ? "You are next." : now.queue ? `${now.queue - 1} before you.` : free >= 0 ? "A seat is free below." : "Waiting for the players.", mayControl ? "Start" : "");
  else if (now.phase === "pause" && alone) show("Paused", `${sentence(now.reason)} You can wait, continue against the computer, or end the match.`, "Continue against the computer", false, "substitute");
  else if (now.phase === "pause" && free >= 0 && !match.study) show("Paused", `${sentence(now.reason)} The player who takes the free seat below starts a new match.`, "");
  else if (now.phase === "pause") show(match.camera ? "Please confirm" : "Paused", now.reason, mayControl ? "Continue" : "");
  else if (now.phase === "done") show(verdict(), why(), mayControl ? "Again" : "");
  else if (flash > 0.3) show("Goal!", "", "", true);
  else if (now.phase === "play" && atRest()) show("", atRest(), "", true);
  else $("notice").hidden = true;
}

const sentence = (text) => (text ? `${text[0].toUpperCase()}${text.slice(1)}.` : "");
const howTo = () => (byTouch ? "Drag a finger on the table: your paddle is above it." : "Move the pointer to move your paddle. Space starts.");

// Why a paddle that somebody leads rests; "" if none does.
function atRest() {
  if (match.camera && now.seat !== null && !held && !steered) return "hold the button down on the table to move the arm";
  return (now.troubles || []).find(Boolean) || "";
}

const brokenOff = () => now.reason || (recording && recording.end.reason !== "played to the end" && recording.end.reason) || "";

// How a result has come about, where the goals alone do not say it.
function why() {
  if (brokenOff() || new Set(match.seats.map((s) => s.team)).size === 1) return brokenOff();
  if (now.decided_by === "shots on goal") return `Same number of goals. The team with more shots on goal wins: ${now.caption}.`;
  return now.success.length ? "" : `Same score: ${now.caption}.`;
}

function verdict() {
  if (brokenOff()) return "Ended early";
  const teams = new Set(match.seats.map((s) => s.team)), won = new Set(now.success.map((i) => match.seats[i].team));
  if (teams.size === 1) return won.size ? "Done!" : "Not this time";
  if (won.size !== 1) return "A draw";
  if (now.seat !== null) return won.has(match.seats[now.seat].team) ? "You win!" : "You lose";
  return `${titleOf(now.success[0])} wins`;
}

let scored = "";
function scoreboard() {
  const text = now.caption || `return ${now.returns[0].toFixed(1)}`;
  if (text === scored) return;
  scored = text;
  const [score, ...rest] = text.split(", ");
  const found = score.match(/^(\D*?)\s*(-?[\d.]+(?: : -?[\d.]+)*)$/), box = $("score");
  box.textContent = "";
  if (!found) { box.textContent = text; return; }
  const add = (cls, words, ink) => { const s = document.createElement("span"); s.className = cls; s.textContent = words; if (ink) s.style.color = ink; box.append(s); };
  add("word", found[1]);
  found[2].split(" : ").forEach((value, i, all) => {
    if (i) add("colon", ":");
    add("value", value, all.length > 1 ? SEAT[i % SEAT.length] : "");
  });
  if (rest.length) add("word rest", rest.join(", "));
}

function titleOf(i) {
  const { driver, level, title } = now.seats[i];
  if (title !== undefined) return i === now.seat ? "You" : title;
  return driver === "person" ? (i === now.seat ? "You" : now.seats[i].taken ? "A person" : "Free seat") : level ? levelTitle(level) : driverTitle(driver);
}

const levelTitle = (name) => (match.ladder.includes(name) ? `${name[0].toUpperCase()}${name.slice(1)}` : driverTitle(name));

// Names that players read; the details have those of the command line.
function driverTitle(name) {
  if (name.startsWith("zoo/")) {
    const kind = name.slice(4).replace(match.scenario, "").replaceAll("_", " ").trim();
    return `Computer, trained${kind ? ` (${kind})` : ""}`;
  }
  const [driver, strength] = name.split(":strength=");
  return driver.startsWith("shadow:") ? "A hand" : `Computer, ${driver.replaceAll("_", " ")}${strength ? `, ${strength}` : ""}`;
}

let panel = "";
function seats(free) {
  const can = !recording && (now.phase === "lobby" || now.phase === "done");
  const state = JSON.stringify([now.seats, now.seat, can, free]);
  if (state === panel) return;
  if (document.activeElement && document.activeElement.closest && document.activeElement.closest("#seats")) return; // being chosen
  panel = state;
  $("seats").textContent = "";
  now.seats.forEach((seat, i) => {
    const box = document.createElement("span"), dot = document.createElement("span");
    box.className = "seat" + (i === now.seat ? " me" : ""); dot.className = "dot"; dot.style.background = colour(i); box.append(dot);
    if (i === now.seat || (seat.driver === "person" && seat.taken)) box.append(titleOf(i));
    else if (now.seat !== null && can && !match.study) {
      const list = document.createElement("select");
      list.setAttribute("aria-label", `player of seat ${i + 1}`);
      for (const name of [...new Set(["person", seat.level || seat.driver, ...match.ladder])]) {
        const option = new Option(name === "person" ? "Another person" : levelTitle(name), name);
        option.selected = name === (seat.level || seat.driver); list.append(option);
      }
      list.onchange = () => { send("opponent", { seat: i, name: list.value }); list.blur(); panel = ""; };
      box.append(list);
    } else if (seat.driver === "person" && !match.study) {
      const sit = document.createElement("button"); sit.textContent = "Take this seat"; sit.onclick = () => send("sit", { seat: i }); box.append(sit);
    } else box.append(titleOf(i));
    $("seats").append(box);
  });
}
