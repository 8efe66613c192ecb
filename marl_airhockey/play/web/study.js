// Study: texts to agree to, questions, breaks, the end.

import { lostNotice, playNotice } from "./screens.js";
import { howTo } from "./start.js";
import { show, hide } from "./notice.js";
import { verdict, why } from "./result.js";
import { $, element, game, on, put, send } from "./state.js";

let sheet = ""; // key of SHEETS that covers the table
let leaving = false; // true while the page asks for a confirmation of withdrawal

const button = (text, act) => { const node = element("button", text, "main"); node.onclick = act; return node; };

function another() { sessionStorage.removeItem("key"); location.reload(); }

const SHEETS = {
  consent() {
    const { title, information, agree, version } = game.match.study, go = button("Take part", () => send("consent", { version }));
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
    const { questions } = game.match.study, go = button("Continue", sendAnswers), fields = questions.map(fieldOf);
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
      element("h1", "The study is complete"), element("p", game.match.study.thanks), ...game.now.study.debriefing.map((text) => element("p", text)), element("p", `Your code is ${game.now.study.code}. You can use it to have your data erased later.`),
      button("Next participant", () => { send("next"); another(); }),
    ];
  },
  erased() {
    return [element("h1", "Erased"), element("p", "All your data have been erased. Thank you."), button("Next participant", () => { send("next"); another(); })];
  },
  leaving() {
    return [
      element("h1", "Withdraw?"), element("p", "This ends your participation and immediately erases all your data."),
      Object.assign(button("Erase everything", () => { leaving = false; send("withdraw"); }), { className: "main danger" }), button("Stay", () => { leaving = false; }),
    ];
  },
};

export function updateStudy() {
  const { match, now } = game, { stage, code } = now.study, sits = now.seat !== null;
  $("withdraw").hidden = !code;
  put($("code"), code ? `your code: ${code}` : "");
  const wanted = leaving && code ? "leaving" : stage in SHEETS ? stage : "";
  if (wanted !== sheet) {
    sheet = wanted;
    $("sheet").replaceChildren(...(wanted ? SHEETS[wanted]() : []));
    $("sheet").hidden = !wanted; $("sheet").scrollTop = 0;
    if (wanted && now.phase === "play") send("pause");
  }
  // A participant who has not begun must not see what somebody else has played.
  document.body.classList.toggle("covered", Boolean(wanted));
  if (wanted) { hide(); return; }
  const { block, game: number, games, time_left, waits } = now.study, start = (text) => [[text, () => send("start")]];
  const part = block < 0 ? "Practice" : `Part ${block + 1} of ${match.study.blocks}`;
  const idle = !["play", "countdown", "pause"].includes(now.phase);
  if (game.down) lostNotice();
  else if (stage === "busy") show("A session is running", "Please wait until it is over.");
  else if (stage === "partner" && idle) show("Please wait", "You play in some parts of this session. Thank you for taking part.");
  else if (stage === "partner" && !sits) show("Please wait", "You play in another part of this session.");
  else if (stage === "rest") show("A break", `${part} begins in ${time_left} s.`);
  else if (stage === "over") show(verdict(), why());
  else if (stage === "ready" && waits) show(part, "Waiting for the other player.");
  else if (stage === "ready" && now.phase === "done" && number) show(verdict(), `${part}: game ${number + 1} of ${games} is next.`, start("Next game"));
  else if (stage === "ready") show(part, `${match.what} ${games} ${games === 1 ? "game" : "games"}. ${howTo()}`, start("Start"));
  else playNotice(stage === "match");
}
$("withdraw").onclick = () => { leaving = true; };
