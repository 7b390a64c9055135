// Our part of the page: stands before viser's script, mends its keys and names, and colours the vertices of meshes.
// Data come in hidden elements, <div hidden data-faceambig="kind" ...> (guard/data.py writes them); nothing is evaluated.
// It leans on names of viser 1.1.1: window.__viserMutable and the shape of a labelled row of its panel.
(() => {
  "use strict";

  // ---- dark -------------------------------------------------------------------------------------------------------
  // The page follows the system. viser reads this at its start, for pages that stand inside others; `?darkMode` still forces it.
  window.__VISER_EMBED_CONFIG__ = { darkMode: window.matchMedia("(prefers-color-scheme: dark)").matches };

  // ---- keys -------------------------------------------------------------------------------------------------------
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

  // A folder opens by Enter and Space like any button (`nameControls` makes it one).
  const CHEVRON = ".mantine-Paper-root > .mantine-Paper-root > [class*=tabler-icon-chevron]";
  document.addEventListener("keydown", (event) => {
    if ((event.key !== "Enter" && event.key !== " ") || !event.target.matches?.(".mantine-Paper-root[role=button]")) return;
    event.preventDefault(); // Space would scroll
    event.target.click();
  });

  // ---- look -------------------------------------------------------------------------------------------------------
  // A finger needs 24 px; viser's thumb is 8 by 12. The half width beyond the ends of the track is padding of the row.
  const style = document.createElement("style");
  style.textContent = `
    .mantine-Slider-thumb { width: 24px !important; height: 24px !important; border-radius: 50% !important; }
    .mantine-Slider-root { padding-block: 8px !important; }
    button[aria-pressed="true"] { background: var(--mantine-primary-color-light); font-weight: 700; }
  `;
  document.head.append(style);

  // ---- data from hidden elements ------------------------------------------------------------------------------------
  const pressed = {}; // label of a button group -> the option that is on
  const valuetext = {}; // label of a slider -> its value in words
  const coloured = new Map(); // name of a node -> what is set on its mesh
  const icons = {}; // viser's icon -> name of the button that shows it
  const seen = new WeakSet(); // viser makes new elements when the content changes
  const readers = {
    title: (element) => (document.title = JSON.parse(element.dataset.json)),
    pressed: (element) => Object.assign(pressed, JSON.parse(element.dataset.json)),
    valuetext: (element) => Object.assign(valuetext, JSON.parse(element.dataset.json)),
    icons: (element) => Object.assign(icons, JSON.parse(element.dataset.json)),
  };

  function readData() {
    for (const element of document.querySelectorAll("[data-faceambig]")) {
      if (seen.has(element)) continue;
      seen.add(element);
      readers[element.dataset.faceambig]?.(element);
    }
  }

  // ---- names --------------------------------------------------------------------------------------------------------
  function set(element, attribute, value) {
    if (element.getAttribute(attribute) !== value) element.setAttribute(attribute, value);
  }

  function nameControls() {
    for (const label of document.querySelectorAll("label[for]")) {
      // A row of viser's panel: <div> <div><p><label></p></div> <div>controls</div> </div>
      const field = label.parentElement?.parentElement?.nextElementSibling;
      if (!field) continue;
      const name = label.textContent.trim();
      const numbered = (all) => (all.length > 1 ? (i) => `${name} ${i + 1}` : () => name);
      const thumbs = field.querySelectorAll("[role=slider]");
      thumbs.forEach((thumb, i) => {
        set(thumb, "aria-label", numbered(thumbs)(i));
        if (name in valuetext) set(thumb, "aria-valuetext", valuetext[name]);
      });
      const inputs = field.querySelectorAll("input:not([type=hidden]), textarea");
      inputs.forEach((input, i) => {
        if (input.id !== label.htmlFor) set(input, "aria-label", numbered(inputs)(i)); // else the label is its name
      });
      const options = field.querySelectorAll(".mantine-Button-root");
      if (options.length) {
        set(options[0].parentElement, "role", "group");
        set(options[0].parentElement, "aria-label", name);
      }
      for (const option of options) {
        if (name in pressed) set(option, "aria-pressed", String(option.textContent === pressed[name]));
      }
    }
    for (const [icon, name] of Object.entries(icons)) {
      for (const drawn of document.querySelectorAll(`button .tabler-icon-${icon}`)) {
        set(drawn.closest("button"), "aria-label", name);
      }
    }
    for (const chevron of document.querySelectorAll(CHEVRON)) {
      const head = chevron.parentElement; // of a folder: viser lets only a mouse open it
      set(head, "role", "button");
      set(head, "tabindex", "0");
      set(head, "aria-expanded", String(chevron.matches(".tabler-icon-chevron-up")));
      set(head.parentElement, "role", "group");
      set(head.parentElement, "aria-label", head.textContent.trim());
    }
  }

  // ---- colours of vertices ------------------------------------------------------------------------------------------
  // three.js computes in linear light and takes vertex colours as they are: sRGB is undone here. Floats, because eight
  // bits of linear light are too coarse for dark colours.
  const LINEAR = Float32Array.from({ length: 256 }, (_, i) => {
    const c = i / 255;
    return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  });

  function linear(bytes) {
    const array = new Float32Array(bytes.length);
    for (let i = 0; i < array.length; i++) array[i] = LINEAR[bytes[i]];
    return array;
  }

  function setColours(node, array) {
    coloured.set(node, { ...coloured.get(node), array, fresh: true });
  }

  // A hidden cloud of points "/x/colours" carries the colours of the meshes beside it. It comes with the vertices, in the
  // same batch of messages, and unlike elements of a panel also while the panel is folded away.
  const carried = new Map(); // name of a mesh -> the colours that a cloud brought for it
  function readClouds() {
    const tree = window.__viserSceneTree.getState();
    for (const name of carried.keys()) {
      const beside = name.slice(0, name.lastIndexOf("/")) + "/colours";
      if (!tree[beside] || !tree[name]) {
        carried.delete(name);
        setColours(name, new Float32Array(0));
      }
    }
    for (const [cloud, node] of Object.entries(tree)) {
      if (!cloud.endsWith("/colours") || node?.message?.type !== "PointCloudMessage") continue;
      const bytes = node.message.props.colors;
      let array = null; // one for all meshes
      for (const [name, other] of Object.entries(tree)) {
        const beside = name.slice(0, name.lastIndexOf("/")) + "/colours";
        if (beside !== cloud || other?.message?.type !== "MeshMessage" || carried.get(name) === bytes) continue;
        carried.set(name, bytes);
        setColours(name, (array ??= linear(bytes)));
      }
    }
  }

  function meshOf(group) {
    let found = null;
    // The first of its meshes that light falls on: the others are shadows, outlines and nodes below it.
    group.traverse((o) => {
      if (!found && o.isMesh && (o.material.isMeshStandardMaterial || o.material.isMeshToonMaterial)) found = o;
    });
    return found;
  }

  function colour(node, entry) {
    const group = window.__viserMutable.nodeRefFromName[node];
    if (!group) return;
    if (entry.group !== group || !entry.mesh?.parent) {
      entry.group = group;
      entry.mesh = meshOf(group);
    }
    if (!entry.mesh) return;
    const { geometry, material } = entry.mesh;
    const position = geometry.attributes.position;
    const on = entry.array.length > 0 && entry.array.length >= 3 * position.count;
    if (on && (entry.fresh || geometry.attributes.color !== entry.attribute)) {
      const old = geometry.attributes.color;
      if (old && old.array.length === entry.array.length) {
        old.array = entry.array; // the buffer of the graphics card stays
        old.needsUpdate = true;
      } else {
        if (old) geometry.dispose(); // else the old buffer would stay there for ever
        geometry.setAttribute("color", new position.constructor(entry.array, 3));
      }
      entry.attribute = geometry.attributes.color;
      entry.fresh = false;
    }
    if (material.vertexColors !== on) {
      material.vertexColors = on;
      material.toneMapped = !on; // viser's film-like curve would shift every colour away from the legend's
      material.needsUpdate = true;
      if (!on && entry.plain !== undefined) material.color.setHex(entry.plain);
    }
    // The node's own colour would be multiplied in; it comes back when the colours go.
    if (on && material.color.getHex() !== 0xffffff) {
      entry.plain = material.color.getHex();
      material.color.setHex(0xffffff);
    }
  }

  // viser makes geometries and materials anew when counts or properties change. Looked at before each picture is drawn,
  // so that none is drawn without; nothing runs between pictures.
  let scene = null;
  function watchScene() {
    const now = window.__viserMutable?.scene;
    if (!now || now === scene) return;
    scene = now;
    const before = scene.onBeforeRender;
    scene.onBeforeRender = function (...args) {
      before.apply(this, args);
      try {
        readClouds();
        for (const [node, entry] of coloured) colour(node, entry);
      } catch (error) {
        scene.onBeforeRender = before; // pictures without colours are better than none
        console.error("colours:", error);
      }
    };
    window.__viserMutable.requestRender();
  }

  new MutationObserver(() => {
    watchScene();
    readData();
    nameControls();
  }).observe(document, { childList: true, subtree: true });
})();
