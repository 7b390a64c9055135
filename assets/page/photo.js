// ---- points on a photograph -----------------------------------------------------------------------------------------------
// A point follows the hand at once; what the server sends next replaces it. The server answers later than the hand
// moves: what has been done here holds until its answer agrees, or for a second and a half.
const PAUSE = 50; // milliseconds between two reports of a moving point
const ANSWER = 1500;
const SLACK = 4; // pixels of the page within which a press is a click
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const moved = new Map(); // index -> {x, y, until}: where it is here, and how long without an answer
let drag = null;
let focusedPoint = null; // index
let waiting = null; // the report that comes after the pause
let pause = null;
let nudged = null; // index that arrow keys move

const pointOf = (index) => document.querySelector(`[data-fa-point="${index}"]`);
const numbers = (text) => text.split(/[x,]/).map(Number);

// Pixels of the photograph: its size, the part that is shown and the box that shows it.
function frameOf(photo) {
  const [width, height] = numbers(photo.dataset.faPhoto);
  const [x, y, w, h] = photo.dataset.faView ? numbers(photo.dataset.faView) : [0, 0, width, height];
  const box = photo.getBoundingClientRect();
  return { width, height, x, y, box, scale: box.width / w, scaleY: box.height / h };
}

function toPhoto(photo, event, offset = { x: 0, y: 0 }) {
  const f = frameOf(photo);
  const x = f.x + (event.clientX - f.box.left) / f.scale + offset.x;
  const y = f.y + (event.clientY - f.box.top) / f.scaleY + offset.y;
  return { x: clamp(x, f.width), y: clamp(y, f.height) };
}

function clamp(value, most) {
  return Math.round(100 * Math.min(Math.max(value, 0), most)) / 100;
}

function placeOf(point) {
  const here = moved.get(point.dataset.faPoint);
  if (here) return here;
  const [x, y] = numbers(point.dataset.faAt);
  return { x, y };
}

function drawPoint(index) {
  const point = pointOf(index);
  const photo = point?.closest("[data-fa-photo]");
  if (!photo) return;
  const own = (point.dataset.faOwn ??= point.getAttribute("transform") ?? "");
  const here = moved.get(index);
  if (!here) return void point.setAttribute("transform", own);
  const f = frameOf(photo);
  const [x, y] = numbers(point.dataset.faAt);
  const units = point.parentNode.getScreenCTM();
  const right = ((here.x - x) * f.scale) / units.a;
  const down = ((here.y - y) * f.scaleY) / units.d;
  point.setAttribute("transform", `translate(${right} ${down}) ${own}`);
}

function movePoint(index, { x, y }, done) {
  moved.set(index, { x, y, until: performance.now() + ANSWER });
  drawPoint(index);
  if (done) setTimeout(forget, ANSWER + 10);
  waiting = { index: Number(index), x, y, done };
  if (done || pause === null) sendPoint();
}

function sendPoint() {
  clearTimeout(pause);
  pause = null;
  if (waiting === null) return;
  report("point", waiting);
  waiting = null;
  pause = setTimeout(sendPoint, PAUSE);
}

function forget() {
  for (const [index, { until }] of moved) {
    if (until > performance.now() || index === drag?.index) continue;
    moved.delete(index);
    drawPoint(index);
  }
}

// After the server has drawn the photograph anew.
const known = new WeakSet();
let asking = false;
function readPhoto() {
  const asks = document.querySelector("[data-fa-photo][data-fa-place]") !== null;
  // What is asked for, and the photograph below it: on a telephone the button that began this is a page below
  if (asks && !asking) document.querySelector("[data-fa-ask]")?.scrollIntoView({ block: "nearest" });
  asking = asks;
  for (const index of moved.keys()) {
    if (index !== drag?.index && !pointOf(index)) moved.delete(index);
  }
  for (const point of document.querySelectorAll("[data-fa-photo] [data-fa-point]")) {
    if (known.has(point)) continue;
    known.add(point);
    if (!point.hasAttribute("tabindex")) point.setAttribute("tabindex", "0");
    if (!point.hasAttribute("role")) point.setAttribute("role", "button");
    const index = point.dataset.faPoint;
    const here = moved.get(index);
    if (here && index !== drag?.index && index !== nudged) {
      const [x, y] = numbers(point.dataset.faAt);
      if (Math.hypot(x - here.x, y - here.y) < 0.5) moved.delete(index); // the server agrees
    }
    drawPoint(index);
    if (index === focusedPoint && document.activeElement === document.body) point.focus({ preventScroll: true });
  }
}

document.addEventListener("focusin", ({ target }) => {
  focusedPoint = target.closest?.("[data-fa-point]")?.dataset.faPoint ?? null;
});
document.addEventListener("focusout", ({ target }) => {
  // Not when the element is being replaced: its successor takes the focus
  queueMicrotask(() => {
    if (target.isConnected && document.activeElement === document.body && document.hasFocus()) focusedPoint = null;
  });
});

// ---- by hand
document.addEventListener("pointerdown", (event) => {
  const photo = event.target.closest?.("[data-fa-photo]");
  if (!photo || drag || event.button !== 0) return;
  const point = event.target.closest("[data-fa-point]");
  const place = photo.dataset.faPlace === "1";
  if (!point && !place && focusedPoint === null) return;
  event.preventDefault(); // no text is selected, and the chosen point keeps its focus
  const hand = toPhoto(photo, event);
  const at = point ? placeOf(point) : hand;
  drag = {
    photo,
    index: point?.dataset.faPoint ?? null,
    chosen: place ? null : focusedPoint, // a click moves it
    pointer: event.pointerId,
    offset: { x: at.x - hand.x, y: at.y - hand.y },
    from: event,
    far: false,
    touch: event.pointerType === "touch",
  };
  point?.focus({ preventScroll: true });
  document.documentElement.setPointerCapture(event.pointerId); // the point itself is soon replaced
  if (drag.touch) showLoupe(photo, at, event);
});

// A finger on a point drags it and scrolls nothing. `touch-action` of what is inside an SVG is not heeded.
document.addEventListener("touchstart", (event) => drag?.index != null && event.preventDefault(), { passive: false });

// Drawn anew, the photograph is another element.
function photoOf({ index, photo }) {
  if (photo.isConnected) return photo;
  return pointOf(index)?.closest("[data-fa-photo]") ?? document.querySelector("[data-fa-photo]");
}

window.addEventListener("pointermove", (event) => {
  if (event.pointerId !== drag?.pointer) return;
  const photo = photoOf(drag);
  if (!photo) return;
  drag.far ||= Math.hypot(event.clientX - drag.from.clientX, event.clientY - drag.from.clientY) > SLACK;
  const at = toPhoto(photo, event, drag.offset);
  if (drag.far && drag.index !== null) movePoint(drag.index, at, false);
  if (drag.touch) showLoupe(photo, at, event);
});

function release(event) {
  if (event.pointerId !== drag?.pointer) return;
  const { index, chosen, far, offset, touch } = drag;
  const photo = photoOf(drag);
  drag = null;
  showLoupe(null);
  if (!photo) return;
  const stopped = event.type === "pointercancel";
  if (index !== null) {
    if (far) movePoint(index, stopped ? placeOf(pointOf(index)) : toPhoto(photo, event, offset), true);
  } else if (!stopped && (touch || !far) && over(photo, event)) {
    if (chosen === null) report("click", toPhoto(photo, event));
    else movePoint(chosen, toPhoto(photo, event), true);
  }
}
window.addEventListener("pointerup", release);
window.addEventListener("pointercancel", release);

function over(photo, { clientX, clientY }) {
  const { left, right, top, bottom } = photo.getBoundingClientRect();
  return clientX >= left && clientX <= right && clientY >= top && clientY <= bottom;
}

// ---- by keys
window.addEventListener(
  "keydown",
  (event) => {
    const point = event.target.closest?.("[data-fa-point]");
    const photo = point?.closest("[data-fa-photo]");
    if (!photo || event.ctrlKey || event.metaKey || event.altKey) return;
    const index = point.dataset.faPoint;
    if (event.key in ARROWS) {
      const step = event.shiftKey ? 10 : 1;
      const [right, down] = ARROWS[event.key];
      const { x, y } = placeOf(point);
      const f = frameOf(photo);
      nudged = index;
      movePoint(index, { x: clamp(x + step * right, f.width), y: clamp(y + step * down, f.height) }, false);
    } else if (event.key === "Delete" || event.key === "Backspace") {
      report("gone", Number(index));
    } else return;
    event.preventDefault();
    event.stopImmediatePropagation(); // the camera stays
  },
  true,
);

function settle() {
  const here = moved.get(nudged);
  if (here) movePoint(nudged, here, true);
  nudged = null;
}
window.addEventListener("keyup", (event) => event.key in ARROWS && nudged !== null && settle(), true);
window.addEventListener("blur", () => nudged !== null && settle());

// ---- magnifier: a finger hides what it points at
const ZOOM = 3;
let loupe = null;
function showLoupe(photo, at, event) {
  if (!photo) {
    loupe?.remove();
    loupe = null;
    return;
  }
  if (!loupe) {
    loupe = document.createElement("div");
    loupe.className = "fa-loupe";
    loupe.setAttribute("aria-hidden", "true");
    document.body.append(loupe);
  }
  const f = frameOf(photo);
  const half = loupe.clientWidth / 2;
  const across = ZOOM * f.scale; // pixels of the page for one of the photograph
  const along = ZOOM * f.scaleY;
  const high = event.clientY > 2 * half + 50; // above the finger, or at its side
  const left = event.clientX + (high ? -half : event.clientX > innerWidth / 2 ? -2 * half - 40 : 40);
  Object.assign(loupe.style, {
    backgroundImage: pictureOf(photo),
    backgroundSize: `${f.width * across}px ${f.height * along}px`,
    backgroundPosition: `${half - at.x * across}px ${half - at.y * along}px`,
    left: `${Math.min(Math.max(left, 4), innerWidth - 2 * half - 8)}px`,
    top: `${Math.max(event.clientY - (high ? 2 * half + 40 : half), 4)}px`,
  });
}

function pictureOf(photo) {
  const own = getComputedStyle(photo).backgroundImage;
  if (own !== "none") return own;
  const inside = photo.querySelector("img, image");
  const source = inside?.currentSrc || inside?.getAttribute("href");
  return source ? `url(${JSON.stringify(source)})` : "none";
}
