// ---- keys ---------------------------------------------------------------------------------------------------------------
// viser turns and flies the camera by these keys wherever the focus is, typing excepted. Its listener is on the
// document too and comes after ours; what the focused control does with the key has happened by then.
const FLIES = /^(Arrow(Up|Down|Left|Right)|Home|End|Key[WASDQE])$/;
const CONTROL = "[role], button, a[href], summary, [tabindex]";
document.addEventListener("keydown", (event) => {
  const camera = window.__viserMutable?.cameraControl;
  const lens = camera && camera.minDistance === camera.maxDistance; // at a fixed distance: flying would change it
  if (FLIES.test(event.code) && (event.target.closest?.(CONTROL) || (lens && event.code.startsWith("Key")))) {
    event.stopImmediatePropagation();
  }
});

// Shortcuts of one key are viser's commands, heard on <html>; switched off, the key does not get there. What is typed
// into a field is no shortcut.
const TYPING = "input, textarea, select, [contenteditable]";
let single = true;
readers.keys = ({ on }) => (single = on);
window.addEventListener(
  "keydown",
  (event) => {
    const plain = event.key.length === 1 && event.key !== " " && !event.ctrlKey && !event.metaKey && !event.altKey;
    if (!single && plain && !event.target.closest?.(TYPING)) event.stopImmediatePropagation();
  },
  true,
);

// Escape belongs to what is open above the page first.
const ABOVE = "dialog[open], [role=dialog], [role=listbox], .mantine-Spotlight-content";
const onEscape = [];
window.addEventListener(
  "keydown",
  (event) => {
    if (event.key !== "Escape" || [...document.querySelectorAll(ABOVE)].some((one) => one.getClientRects().length)) return;
    for (const end of onEscape) end();
    report("key", "Escape");
  },
  true,
);

// A folder opens by Enter and Space like any button (`nameControls` makes it one).
const CHEVRON = ".mantine-Paper-root > .mantine-Paper-root > [class*=tabler-icon-chevron]";
document.addEventListener("keydown", (event) => {
  if ((event.key !== "Enter" && event.key !== " ") || !event.target.matches?.(".mantine-Paper-root[role=button]")) return;
  event.preventDefault(); // Space would scroll
  event.target.click();
});

// A hand that turns the viewer: only then is a new place of the camera news for the state. viser also moves it by itself,
// while a page opens, a panel is docked or the window grows.
const HAND = 300; // ms between two reports of one hand
let handAt = -Infinity;
function byHand() {
  if (performance.now() - handAt < HAND) return;
  handAt = performance.now();
  report("hand", true);
}
for (const kind of ["pointerdown", "pointermove", "wheel"]) {
  window.addEventListener(
    kind,
    (event) => {
      if (event.target === window.__viserMutable?.canvas && (kind !== "pointermove" || event.buttons)) byHand();
    },
    { capture: true, passive: true },
  );
}
document.addEventListener("keydown", (event) => {
  if (FLIES.test(event.code) && !event.target.closest?.(TYPING)) byHand(); // stopped above where a control has the key
});
