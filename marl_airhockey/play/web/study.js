"use strict";
// Study: texts to agree to, questions, breaks, the end.

let sheet = ""; // key of SHEETS that covers the table
let leaving = false; // true while the page asks for a confirmation of withdrawal

const element = (tag, text = "", cls = "") => {
  const node = document.createElement(tag);
  node.textContent = text; node.className = cls;
  return node;
};
const button = (text, act) => { const node = element("button", text, "main"); node.onclick = act; return node; };

function another() { sessionStorage.removeItem("key"); location.reload(); }

const SHEETS = {
  consent() {
    const { title, information, agree, version } = match.study, go = button("Take part", () => send("consent", { version }));
    const boxes = agree.map((line) => {
      const label = element("label", "", "tick"), box = element("input");
      box.type = "checkbox"; label.append(box, line);
      box.onchange = () => { go.disabled = !boxes.every((b) => b.firstChild.checked); };
      return label;
    });
    go.disabled = true;
    return [element("h1", title), ...information.map((text) => element("p", text)), ...boxes, go];
  },
  questions() {
    const { questions } = match.study, go = button("Continue", sendAnswers), fields = questions.map(fieldOf);
    function fieldOf(question) {
      if (question.free) {
        const field = element("fieldset"), box = element("textarea");
        box.name = question.id; box.maxLength = 800; box.rows = 3; box.setAttribute("aria-label", question.text);
        field.append(element("legend", question.text), box);
        return field;
      }
      const field = element("fieldset"), row = element("div", "", question.choices.length ? "choices" : "scale");
      field.append(element("legend", question.text), row);
      if (question.low) row.append(element("span", question.low, "end"));
      for (let value = 1; value <= question.largest; value++) {
        const label = element("label"), dot = element("input");
        dot.type = "radio"; dot.name = question.id; dot.value = value;
        dot.onchange = () => { go.disabled = !complete(); };
        label.append(dot, question.choices[value - 1] || String(value)); row.append(label);
      }
      if (question.high) row.append(element("span", question.high, "end"));
      return field;
    }
    function complete() { return fields.every((f) => f.querySelector("textarea, input:checked")); }
    function sendAnswers() {
      for (const field of fields) {
        const dot = field.querySelector("input:checked"), box = field.querySelector("textarea");
        if (box) send("comment", { question: box.name, text: box.value });
        else send("answer", { question: dot.name, value: Number(dot.value) });
      }
    }
    go.disabled = !complete();
    return [element("h1", "How was it?"), ...fields, go];
  },
  end() {
    return [
      element("h1", "The study is complete"), element("p", match.study.thanks), ...now.study.debriefing.map((text) => element("p", text)), element("p", `Your code is ${now.study.code}. You can use it to have your data erased later.`),
      button("Next participant", () => { send("next"); another(); }),
    ];
  },
  erased() {
    return [element("h1", "Erased"), element("p", "All your data have been erased. Thank you."), button("Next participant", () => { send("next"); another(); })];
  },
  leaving() {
    return [
      element("h1", "Withdraw?"), element("p", "This ends your participation and immediately erases all your data."),
      button("Erase everything", () => { leaving = false; send("withdraw"); }), button("Stay", () => { leaving = false; }),
    ];
  },
};

function updateStudyWords() {
  const { stage, code } = now.study, runs = now.phase === "play" || now.phase === "countdown", sits = now.seat !== null;
  for (const name of OF_PLAYERS) $(name).hidden = true;
  put($("pause"), runs ? "Pause" : "Start");
  $("pause").disabled = !sits || !(stage === "match" || (stage === "ready" && !now.study.waits));
  $("withdraw").hidden = !code;
  put($("code"), code ? `your code: ${code}` : "");
  canvas.classList.toggle("mine", sits && now.phase === "play");
  seats(-1);
  const wanted = leaving && code ? "leaving" : stage in SHEETS ? stage : "";
  if (wanted !== sheet) {
    sheet = wanted;
    $("sheet").replaceChildren(...(wanted ? SHEETS[wanted]() : []));
    $("sheet").hidden = !wanted; $("sheet").scrollTop = 0;
    if (wanted && now.phase === "play") send("pause");
  }
  // Who has not begun must not see what somebody else has played.
  document.body.classList.toggle("covered", Boolean(wanted));
  if (wanted) { $("notice").hidden = true; return; }
  const { block, game, games, time_left, waits } = now.study, where = block < 0 ? "Practice" : `Part ${block + 1} of ${match.study.blocks}`;
  if (down) show("No connection", refused || "trying again…", "");
  else if (stage === "busy") show("A session is running", "Please wait until it is over.", "");
  else if (stage === "partner" && now.phase !== "play" && now.phase !== "countdown" && now.phase !== "pause") show("Please wait", "You play in some parts of this session. Thank you for taking part.", "");
  else if (stage === "partner" && !sits) show("Please wait", "You play in another part of this session.", "");
  else if (stage === "rest") show("A break", `${where} begins in ${time_left} s.`, "");
  else if (stage === "over") show(verdict(), why(), "");
  else if (stage === "ready" && waits) show(where, "Waiting for the other player.", "");
  else if (stage === "ready" && now.phase === "done" && game) show(verdict(), `${where}: game ${game + 1} of ${games} is next.`, "Next game");
  else if (stage === "ready") show(where, `${match.what} ${games} ${games === 1 ? "game" : "games"}. ${howTo()}`, "Start");
  else notice(sits, -1, stage === "match");
}
