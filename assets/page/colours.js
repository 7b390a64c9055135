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

const coloured = new Map(); // name of a node -> what is set on its mesh
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

// viser makes geometries and materials anew when counts or properties change, so they are looked at for each picture.
beforePicture.push(() => {
  readClouds();
  for (const [node, entry] of coloured) colour(node, entry);
});
