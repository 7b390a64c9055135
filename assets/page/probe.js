// ---- millimetres under the pointer ------------------------------------------------------------------------------------
// Where a mouse rests, where it clicks and where a finger taps, the vertex that is seen there is found here and told; the
// server, which has the numbers, answers with words. viser's own clicks would outline the heads and cost a search for
// every move of the pointer.
const LINGER = 150; // milliseconds a mouse rests
const TAP = 10; // pixels of the page within which a finger's press is a tap
const HEADS = /^\/([^/]+)\/(head|draft)$/;
const REACH = 100; // metres: beyond everything
const SOLID = 0.5; // opacity from which a head is what is pointed at
const tag = document.createElement("div");
tag.className = "fa-under";
tag.hidden = true;
let probing = false; // whether the colours of a head are numbers
let question = 0; // number of the question asked last
let askedAt = null; // {x, y} of it
let lingering = null;
let downAt = null; // {x, y} where a button or a finger went down

readers.probe = ({ on }) => {
  probing = on;
  if (!on) hideTag();
};
readers.probed = ({ n, text }) => {
  if (n !== question || !askedAt || !text) return void (tag.hidden = true);
  tag.textContent = text;
  tag.hidden = false;
  tag.style.left = `${Math.max(4, Math.min(askedAt.x + 12, innerWidth - tag.offsetWidth - 4))}px`;
  tag.style.top = `${Math.max(4, askedAt.y - tag.offsetHeight - 10)}px`;
};
onConnection.push(() => readers.probe({ on: false }));

function hideTag() {
  clearTimeout(lingering);
  askedAt = null; // an answer on its way comes too late
  tag.hidden = true;
}

function ask({ clientX: x, clientY: y }) {
  hideTag();
  const hit = probing && under(x, y);
  if (!hit) return;
  askedAt = { x, y };
  report("probe", { n: ++question, head: hit.head, vertex: hit.vertex });
}

// The head and the vertex seen at a place of the window. A place on the ray is its share of the way from near to far,
// the same in every head's own axes.
function under(x, y) {
  const { camera, canvas, nodeRefFromName } = window.__viserMutable;
  const box = canvas.getBoundingClientRect();
  const at = [(2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height];
  // From the eye through a place in front of it: which depth is near and which far, viser's renderer turns round
  const near = camera.position.clone();
  const far = camera.position.clone().set(...at, 0.5).unproject(camera).sub(near).setLength(REACH).add(near);
  let best = null;
  for (const [name, group] of Object.entries(nodeRefFromName)) {
    const head = HEADS.exec(name)?.[1];
    if (!head || !group || !isSeen(group)) continue; // null: a node that has gone
    const mesh = meshOf(group);
    if (!mesh || mesh.material.opacity < SOLID) continue;
    const back = mesh.matrixWorld.clone().invert();
    const hit = firstHit(mesh.geometry, near.clone().applyMatrix4(back), far.clone().applyMatrix4(back));
    if (hit && !(best?.share <= hit.share)) best = { ...hit, head };
  }
  return best;
}

function isSeen(object) {
  for (let o = object; o; o = o.parent) if (!o.visible) return false;
  return true;
}

// Triangle by triangle (Möller and Trumbore): 7,000 of them take less than a millisecond.
function firstHit({ index, attributes: { position } }, a, b) {
  if (!index) return null;
  const [corners, p] = [index.array, position.array];
  const [dx, dy, dz] = [b.x - a.x, b.y - a.y, b.z - a.z];
  let best = null;
  for (let i = 0; i < corners.length; i += 3) {
    const [o, q, r] = [3 * corners[i], 3 * corners[i + 1], 3 * corners[i + 2]];
    const [ux, uy, uz] = [p[q] - p[o], p[q + 1] - p[o + 1], p[q + 2] - p[o + 2]];
    const [vx, vy, vz] = [p[r] - p[o], p[r + 1] - p[o + 1], p[r + 2] - p[o + 2]];
    const [hx, hy, hz] = [dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx];
    const det = ux * hx + uy * hy + uz * hz;
    if (det === 0) continue;
    const [sx, sy, sz] = [a.x - p[o], a.y - p[o + 1], a.z - p[o + 2]];
    const u = (sx * hx + sy * hy + sz * hz) / det;
    if (u < 0 || u > 1) continue;
    const [kx, ky, kz] = [sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux];
    const v = (dx * kx + dy * ky + dz * kz) / det;
    if (v < 0 || u + v > 1) continue;
    const share = (vx * kx + vy * ky + vz * kz) / det;
    if (share <= 0 || share > 1 || best?.share <= share) continue;
    const nearest = u >= v ? (u >= 1 - u - v ? 1 : 0) : v >= 1 - u - v ? 2 : 0; // corner of the largest share
    best = { share, vertex: corners[i + nearest] };
  }
  return best;
}

const onCanvas = (event) => event.target === window.__viserMutable?.canvas;
const apart = (event, place) => Math.hypot(event.clientX - place.x, event.clientY - place.y);
const quietly = { capture: true, passive: true };
window.addEventListener(
  "pointermove",
  (event) => {
    if (event.pointerType !== "mouse") return;
    if (askedAt && onCanvas(event) && apart(event, askedAt) <= SLACK) return;
    hideTag();
    if (probing && onCanvas(event) && !event.buttons) lingering = setTimeout(ask, LINGER, event);
  },
  quietly,
);
window.addEventListener(
  "pointerdown",
  (event) => {
    hideTag();
    downAt = onCanvas(event) ? { x: event.clientX, y: event.clientY } : null;
  },
  quietly,
);
window.addEventListener(
  "pointerup",
  (event) => {
    if (downAt && apart(event, downAt) <= (event.pointerType === "mouse" ? SLACK : TAP)) ask(event);
    downAt = null;
  },
  quietly,
);
for (const kind of ["wheel", "keydown", "blur"]) window.addEventListener(kind, hideTag, quietly);
document.addEventListener("DOMContentLoaded", () => document.body.append(tag));
