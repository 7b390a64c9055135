// ---- what a person has unfolded or emptied --------------------------------------------------------------------------------
// The server sends words as a whole, and what was unfolded in them comes folded. Unfolded is what had these words before.
const unfolded = new Set(); // words of summaries
const folds = new WeakSet(); // elements that have been seen: from there on the hand alone folds them
let focusedFold = null; // words of the summary that has the focus
const wordsOf = (details) => details.querySelector("summary")?.textContent ?? "";

function keepUnfolded() {
  for (const details of document.querySelectorAll("details")) {
    if (folds.has(details)) continue;
    folds.add(details);
    const title = wordsOf(details);
    if (unfolded.has(title)) details.open = true;
    if (title === focusedFold && document.activeElement === document.body) {
      details.querySelector("summary").focus({ preventScroll: true });
    }
  }
}

// A step of a lesson that begins is brought into view: on a phone it was chosen, or the one before left, far below it.
let step = null; // lesson and step that were there last

function showStep() {
  const text = document.querySelector("[data-fa-step]");
  const now = text?.dataset.faStep ?? null;
  if (now === step) return;
  step = now;
  if (!text) return;
  const { top, height } = text.getBoundingClientRect();
  if (top < 0 || top + Math.min(height, 100) > innerHeight) text.scrollIntoView({ block: "start" });
}

document.addEventListener(
  "toggle", // it does not bubble
  ({ target }) => {
    if (target.tagName === "DETAILS") unfolded[target.open ? "add" : "delete"](wordsOf(target));
  },
  true,
);
document.addEventListener("focusin", ({ target }) => {
  focusedFold = target.tagName === "SUMMARY" ? target.textContent : null;
});
document.addEventListener("focusout", ({ target }) => {
  // Not when the element is being replaced: its successor takes the focus
  queueMicrotask(() => {
    if (target.isConnected && document.activeElement === document.body && document.hasFocus()) focusedFold = null;
  });
});

// What is typed into a number field is told when the hand rests, on Enter and on leaving: viser tells every key, so on the
// way from 120 to 60 the server would set the 1 to the least value and write that into the field. Left empty, a field gets
// back what stood in it; viser would leave it so until the value changes.
const NUMBER = ".mantine-NumberInput-input";
const RESTS = 1000; // milliseconds
const KEYS_TELL = new Set(["Enter", "ArrowUp", "ArrowDown"]);
const writeValue = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set; // React has its own before it
let typed = null; // {field, uuid of its control, stood: its text before, waiting: what viser would tell, timer}

function uuidOf(field) {
  if (field.id) return field.id;
  for (let row = field.parentElement; row; row = row.parentElement) {
    const label = row.querySelector("label[for]"); // of a slider with a number box: the slider is the control
    if (label) return label.htmlFor;
  }
  return "";
}

document.addEventListener("beforeinput", ({ target, data }) => {
  if (!target.matches?.(NUMBER)) return;
  typed ??= { field: target, uuid: uuidOf(target), stood: target.value, waiting: null, timer: null };
  clearTimeout(typed.timer);
  typed.timer = setTimeout(() => take(), RESTS);
  if (/[^\d\s.,+-]/.test(data ?? "")) tellFor(words.number, BACK); // a letter is not even written
});

holds.push((given) => {
  const { type, uuid } = given.message ?? {};
  if (typed === null || type !== "GuiUpdateMessage" || uuid !== typed.uuid) return false;
  typed.waiting = given;
  return true;
});

function take(left = false) {
  if (typed === null || (!left && typed.field.value === "")) return; // more will come
  const { field, stood, waiting, timer } = typed;
  clearTimeout(timer);
  typed = null;
  if (waiting && field.value !== "") socket?.postMessage(waiting);
  if (field.isConnected && field.value === "") {
    writeValue.call(field, stood);
    field.dispatchEvent(new Event("input", { bubbles: true }));
  }
}

// Before viser hears of them
window.addEventListener("focusout", ({ target }) => target === typed?.field && take(true), true);
window.addEventListener("pointerdown", ({ target }) => target !== typed?.field && take(true), true);
window.addEventListener("keydown", ({ key, target }) => KEYS_TELL.has(key) && target === typed?.field && take(), true);
