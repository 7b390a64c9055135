// ---- before each picture --------------------------------------------------------------------------------------------------
// What must hold in every picture is set just before it is drawn, so that none is drawn without; nothing runs between
// pictures. viser has set the nodes of its scene by then.
const beforePicture = [];
let scene = null;
function watchScene() {
  const now = window.__viserMutable?.scene;
  if (!now || now === scene) return;
  scene = now;
  const stock = scene.onBeforeRender;
  scene.onBeforeRender = function (...args) {
    stock.apply(this, args);
    for (const [i, act] of beforePicture.entries()) {
      try {
        act?.();
      } catch (error) {
        beforePicture[i] = null; // pictures without it are better than none
        console.error("before a picture:", error);
      }
    }
  };
  window.__viserMutable.requestRender();
}

// ---- blink ----------------------------------------------------------------------------------------------------------------
// A hard cut: a blank between two pictures would hide the change that is to be seen.
const SHORTEST = 0.4; // seconds a node is shown: fewer than three flashes in a second
let blink = null; // {nodes, span, start}
let cut = null; // timer of the next picture

readers.blink = ({ nodes, seconds }) => {
  if (!nodes.length) return endBlink();
  const span = 1000 * Math.max(SHORTEST, seconds);
  blink = { nodes, span, start: performance.now() };
  nextCut();
};

function endBlink() {
  clearTimeout(cut);
  blink = null; // viser sets what is visible before each picture
  window.__viserMutable?.requestRender();
}
onEscape.push(endBlink);
onConnection.push(endBlink);

function nextCut() {
  clearTimeout(cut);
  window.__viserMutable?.requestRender();
  const left = blink.span - ((performance.now() - blink.start) % blink.span);
  if (!stillness.matches) cut = setTimeout(nextCut, left + 1);
}
stillness.addEventListener("change", () => blink && nextCut());

beforePicture.push(() => {
  if (!blink) return;
  const groups = blink.nodes.map((name) => window.__viserMutable.nodeRefFromName[name]).filter(Boolean);
  const turn = stillness.matches ? 0 : Math.floor((performance.now() - blink.start) / blink.span);
  groups.forEach((group, i) => (group.visible = i === turn % groups.length));
});
