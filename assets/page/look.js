// ---- theme and size of text -------------------------------------------------------------------------------------------
// The server's theme rules as soon as it says one. Before that, and between two connections, the page follows the
// address, what was kept, or the system; viser's script asks `dark` (see PATCHES). `?darkMode` still forces it.
const KEPT = "faceambig:look";
const system = window.matchMedia("(prefers-color-scheme: dark)");
const stillness = window.matchMedia("(prefers-reduced-motion: reduce)");
const asked = new URLSearchParams(location.search);
const look = { theme: null, text: null }; // null: nobody has chosen
let themed = false;

function choose({ theme, text }) {
  if (["auto", "light", "dark"].includes(theme)) look.theme = theme;
  if (Number.isFinite(text) && text >= 1 && text <= 2) look.text = text;
  document.documentElement.style.setProperty("--fa-scale", look.text ?? 1);
}

function kept() {
  try {
    return JSON.parse(localStorage.getItem(KEPT)) ?? {};
  } catch {
    return {}; // refused by the browser, or not ours
  }
}

choose(kept());
const before = { ...look }; // as kept: what "hello" tells
choose({ theme: asked.get("theme"), text: Number(asked.get("text") ?? NaN) });

window.__faceambig = {
  dark(server) {
    if (themed) return server;
    return look.theme === "dark" || (look.theme !== "light" && system.matches);
  },
};

readers.theme = (value) => {
  themed = true;
  choose(value);
  try {
    localStorage.setItem(KEPT, JSON.stringify(look));
    Object.assign(before, look);
  } catch {
    // refused by the browser: the address still holds it
  }
};
onConnection.push(() => (themed = false));
system.addEventListener("change", () => report("dark", system.matches));

// ---- the address, and the first word ----------------------------------------------------------------------------------
const VISERS = /^(darkMode|fixedDpr|initialCamera[A-Za-z]*)=/; // they do no harm

readers.address = ({ query }) => {
  const own = location.search.slice(1).split("&").filter((piece) => VISERS.test(piece + "="));
  const pieces = query === "" ? own : [...own, query];
  const target = pieces.length ? `/?${pieces.join("&")}` : "/";
  if (target !== location.pathname + location.search + location.hash) history.replaceState(null, "", target);
};

readers.report = ({ uuid }) => {
  reports = uuid;
  report("hello", {
    query: location.search.slice(1),
    reduced_motion: stillness.matches,
    touch: window.matchMedia("(pointer: coarse)").matches,
    dark: system.matches,
    languages: navigator.languages.slice(0, 8).map((tag) => tag.slice(0, 40)),
    ...before,
  });
};

// ---- no wider than the window -------------------------------------------------------------------------------------------
// A list that opens stands beyond the edge for a moment. A phone would zoom out for it and lay the page out wider, which
// moves the list on: it never came to rest. Zooming in stays possible.
document.querySelector("meta[name=viewport]")?.setAttribute("content", "width=device-width, initial-scale=1, minimum-scale=1");

// ---- style --------------------------------------------------------------------------------------------------------------
// A finger needs 24 px; viser's thumb is 8 by 12. The half width beyond the ends of the track is padding of the row.
const style = document.createElement("style");
style.textContent = `
  :root { font-size: calc(100% * var(--fa-scale, 1)); }
  .mantine-Slider-thumb { width: 24px !important; height: 24px !important; border-radius: 50% !important; }
  .mantine-Slider-root { padding-block: 8px !important; }
  .mantine-Button-root { min-height: 30px !important; height: auto !important; }
  .mantine-ActionIcon-root, [role=button][aria-label$="panel area"] { min-height: 24px !important; min-width: 24px !important; }
  .mantine-NumberInput-input { min-height: 24px !important; }
  .mantine-NumberInput-controls { flex-direction: row-reverse !important; width: 52px !important; max-width: none !important;
    height: 100% !important; }
  .mantine-Input-wrapper:has(.mantine-NumberInput-controls) input { padding-inline-end: 56px !important; }
  .mantine-NumberInput-control { flex: 0 0 26px !important; max-width: none !important; height: 100% !important;
    border: 0 !important; }
  .mantine-NumberInput-section:has(.mantine-NumberInput-controls) { width: 52px !important; }
  .mantine-Checkbox-inner, .mantine-Checkbox-input { width: 24px !important; height: 24px !important; }
  .mantine-Paper-root[role=button] { min-height: 24px; }
  :focus-visible { outline: 2px solid #1b5fc1 !important; outline-offset: 2px; scroll-margin: 3em; }
  [data-mantine-color-scheme=dark] :focus-visible { outline-color: #7ab7ff !important; }
  [data-fa-copy], [data-fa-place="1"] { cursor: pointer; }
  [data-fa-point] { cursor: grab; }
  [data-fa-place="1"] { touch-action: none; }
  .fa-status { position: fixed; top: 8px; left: 50%; transform: translateX(-50%); z-index: 1000; max-width: 90vw;
    padding: 6px 14px; border-radius: 8px; background: #1d2733; color: #fff; font: 14px/1.45 system-ui, sans-serif;
    pointer-events: none; }
  .fa-status:empty { padding: 0; }
  .fa-spoken { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
  .fa-under { position: fixed; z-index: 1000; padding: 3px 9px; border-radius: 6px; background: #1d2733; color: #fff;
    font: 13px/1.4 system-ui, sans-serif; pointer-events: none; max-width: 90vw; }
  .fa-loupe { position: fixed; z-index: 1000; width: 126px; height: 126px; border-radius: 50%; pointer-events: none;
    border: 2px solid #fff; box-shadow: 0 0 0 1px #1d2733; background-repeat: no-repeat; background-color: #cbd5e0; }
  .fa-loupe::before, .fa-loupe::after { content: ""; position: absolute; background: #c8102e; outline: 1px solid #fffc; }
  .fa-loupe::before { left: 50%; top: 42%; height: 16%; width: 1px; }
  .fa-loupe::after { top: 50%; left: 42%; width: 16%; height: 1px; }
  .fa-copy { border: 1px solid; border-radius: 8px; padding: 12px; max-width: 90vw; }
  .fa-copy input { display: block; width: 30em; max-width: 100%; margin: 8px 0; }
`;
document.head.append(style);
