// ---- the line that says how it stands -----------------------------------------------------------------------------------
const BACK = 4000; // milliseconds
const line = document.createElement("div");
line.className = "fa-status";
line.setAttribute("role", "status");
let wasLost = false;
let clearing = null;

function canDraw() {
  try {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2") ?? canvas.getContext("webgl");
    gl?.getExtension("WEBGL_lose_context")?.loseContext(); // browsers keep only a few
    return gl !== null;
  } catch {
    return false;
  }
}

function say(text) {
  line.textContent = text;
}

function tellFor(text, milliseconds) {
  say(text);
  clearTimeout(clearing);
  clearing = setTimeout(() => (wasLost ? say(words.lost) : rest()), milliseconds);
}

onConnection.push((there) => {
  clearTimeout(clearing);
  if (!there) {
    wasLost = true;
    say(words.lost);
  } else if (wasLost) {
    wasLost = false;
    tellFor(words.back, BACK);
  }
});

// ---- what a screen reader says --------------------------------------------------------------------------------------------
// In an element that stays: a live region that comes with its words is not read. viser's panels replace theirs.
const SILENCE = 600; // milliseconds after the last change
const spoken = document.createElement("div");
spoken.className = "fa-spoken";
spoken.setAttribute("aria-live", "polite");
let sentence = "";
let speaking = null;

function speak() {
  const now = document.querySelector("[data-fa-spoken]")?.textContent || sentence;
  if (now === sentence) return;
  sentence = now;
  clearTimeout(speaking);
  speaking = setTimeout(() => (spoken.textContent = sentence), SILENCE);
}

let rest = () => say("");

function begin() {
  document.body.append(line, spoken);
  set(document.getElementById("root"), "role", "main"); // a place to jump to
  if (!canDraw()) rest = () => say(words.no_webgl);
  rest();
}
document.addEventListener("DOMContentLoaded", begin);

// Where what is sent goes: the address under which this browser knows the page.
function nameHost() {
  for (const element of document.querySelectorAll("[data-fa-host]")) {
    if (element.textContent !== location.host) element.textContent = location.host;
  }
}

// ---- what comes with the page, and what changes in it ---------------------------------------------------------------------
for (const element of document.querySelectorAll("meta[data-faceambig]")) read(element);

new MutationObserver(() => {
  watchScene();
  nameControls();
  nameCopies();
  readPhoto();
  keepUnfolded();
  showStep();
  nameHost();
  speak();
}).observe(document, { childList: true, subtree: true });
