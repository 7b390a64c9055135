// The standalone page: draws the faces that lie in the file. Nothing of a face is computed here: at a stop the words
// and places are the program's (player.py wrote them), while it plays the faces move straight from stop to stop.
// It asks for nothing and makes no code of text; styles are set through the DOM only: the policy wants it so.
(() => {
  "use strict";
  const at = (id) => document.getElementById(id);
  const data = JSON.parse(at("data").textContent);
  const canvas = at("heads"), slider = at("slider");
  const still = window.matchMedia("(prefers-reduced-motion: reduce)");
  const STILL_MS = 1500, REST_MS = 600, DEGREES_PER_PIXEL = 0.4;

  let track = data.tracks[0];
  let position = track.start; // in stops; whole numbers at rest
  let playing = false, forward = true, last = 0, timer = 0, rest = 0, asked = false;
  let view = { azimuth: data.views[data.view][0], elevation: data.views[data.view][1] };
  let difference = data.difference;
  let arrays = null, drawer = null;

  // ---- words, plots, points -----------------------------------------------------------------------------------------
  const between = (values, where) => {
    const a = Math.min(Math.floor(where), values.length - 1), b = Math.min(a + 1, values.length - 1);
    return values[a] + (values[b] - values[a]) * (where - a);
  };

  function words() {
    const stop = track.stops[Math.round(position)];
    at("d_l").textContent = stop.d_l;
    at("d_s").textContent = stop.d_s;
    at("place").textContent = stop.place;
    at("under").textContent = stop.under;
    at("warning").textContent = stop.warning;
    at("warning").hidden = !stop.warning;
    slider.value = Math.round(position);
    slider.setAttribute("aria-valuetext", stop.place);
    clearTimeout(rest);
    rest = setTimeout(() => { at("spoken").textContent = stop.spoken; }, REST_MS);
  }

  function cursor() {
    const mark = (kind) => document.querySelector(`[data-track="${track.name}"] .cursor ${kind}`);
    const [x, l, s] = track.cursor.map((values) => between(values, position));
    mark("path").setAttribute("transform", `translate(${x} 0)`);
    mark("circle").setAttribute("transform", `translate(${x} ${l})`);
    mark("rect").setAttribute("transform", `translate(${x - 4.2} ${s - 4.2})`);
  }

  function circles() {
    const points = arrays && arrays[`${track.name}_points`];
    if (!points) return;
    const a = Math.floor(position), b = Math.min(a + 1, track.stops.length - 1), t = position - a, r = data.circle;
    let path = "";
    for (let i = 0; i < points.columns; i += 2) {
      const [x, y] = [i, i + 1].map((k) => data.pixels * (points.row(a)[k] * (1 - t) + points.row(b)[k] * t));
      path += `M${(x - r).toFixed(2)} ${y.toFixed(2)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`;
    }
    for (const place of document.querySelectorAll("[data-circles]")) place.setAttribute("d", path);
  }

  function show() {
    words();
    cursor();
    circles();
    redraw();
  }

  function redraw() {
    if (asked || !drawer) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      drawer.draw(track, position, view, difference);
    });
  }

  // ---- playing ------------------------------------------------------------------------------------------------------
  function go(where) {
    position = Math.min(Math.max(where, 0), track.stops.length - 1);
    show();
  }

  function stop() {
    playing = false;
    clearTimeout(timer);
    at("play").textContent = data.words.play;
    go(Math.round(position));
  }

  function play() {
    playing = true;
    at("play").textContent = data.words.pause;
    if (still.matches) {
      timer = setTimeout(jump, 0);
    } else {
      last = performance.now();
      requestAnimationFrame(glide);
    }
  }

  function jump() { // reduced motion: a picture at a time, no glide
    if (!playing) return;
    go(track.marks.find((mark) => mark > position) ?? track.marks[0]);
    timer = setTimeout(jump, STILL_MS);
  }

  function glide(now) {
    if (!playing) return;
    const step = Math.min(now - last, 100) / (1000 * track.seconds);
    last = now;
    let share = between(track.along, position) + (forward ? step : -step);
    if (share >= 1 || share <= 0) forward = share <= 0;
    share = Math.min(Math.max(share, 0), 1);
    let after = track.along.findIndex((place) => place > share);
    if (after < 0) after = track.along.length - 1;
    const before = Math.max(after - 1, 0), span = track.along[after] - track.along[before];
    go(before + (span ? (share - track.along[before]) / span : 0));
    requestAnimationFrame(glide);
  }

  // ---- controls -----------------------------------------------------------------------------------------------------
  at("play").addEventListener("click", () => (playing ? stop() : play()));
  slider.addEventListener("input", () => {
    const where = Number(slider.value);
    if (playing) stop();
    go(where);
  });
  at("difference").addEventListener("click", () => {
    difference = !difference;
    coloured();
  });

  function coloured() {
    at("difference").setAttribute("aria-pressed", difference);
    at("legend").hidden = !difference;
    redraw();
  }

  function press(kind, chosen) {
    for (const button of document.querySelectorAll(`[data-${kind}-button]`)) {
      button.setAttribute("aria-pressed", button === chosen);
    }
  }

  for (const button of document.querySelectorAll("[data-view-button]")) {
    button.addEventListener("click", () => {
      [view.azimuth, view.elevation] = data.views[button.dataset.viewButton];
      press("view", button);
      redraw();
    });
  }
  for (const button of document.querySelectorAll("[data-track-button]")) {
    button.addEventListener("click", () => {
      if (playing) stop();
      track = data.tracks.find((one) => one.name === button.dataset.trackButton);
      forward = true;
      press("track", button);
      for (const plots of document.querySelectorAll("[data-track]")) plots.hidden = plots.dataset.track !== track.name;
      at("label").textContent = track.label;
      slider.max = track.stops.length - 1;
      go(track.start);
    });
  }

  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.target.closest("summary, a")) return;
    const end = track.stops.length - 1, here = Math.round(position);
    const where = { ArrowRight: here + 1, ArrowUp: here + 1, ArrowLeft: here - 1, ArrowDown: here - 1, Home: 0, End: end }[event.key];
    if (event.key === " ") {
      if (event.target.closest("button")) return; // Space presses it
      event.preventDefault();
      at("play").click();
    } else if (where !== undefined) {
      event.preventDefault(); // and no scrolling
      if (playing) stop();
      go(where);
    } else if (event.key === "Escape" && playing) {
      stop();
    }
  });

  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    held = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    view.azimuth -= DEGREES_PER_PIXEL * (event.clientX - held[0]);
    view.elevation += DEGREES_PER_PIXEL * (event.clientY - held[1]);
    view.elevation = Math.min(Math.max(view.elevation, -89), 89);
    held = [event.clientX, event.clientY];
    press("view", null);
    redraw();
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { held = null; });

  // ---- the geometry -------------------------------------------------------------------------------------------------
  const KINDS = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i2: Int16Array, i4: Int32Array };

  async function unpack(text) {
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = await new Response(stream).arrayBuffer();
    const found = {};
    let start = 0;
    for (const { name, kind, rows, columns } of data.arrays) {
      const size = rows * columns * KINDS[kind].BYTES_PER_ELEMENT;
      const values = new KINDS[kind](bytes.slice(start, start + size));
      start += size;
      for (let r = 0; r < rows; r++) { // rows are differences that wrap around, and so do typed arrays
        for (let i = r * columns + 1; i < (r + 1) * columns; i++) values[i] += values[i - 1];
      }
      found[name] = { rows, columns, row: (r) => values.subarray(r * columns, (r + 1) * columns) };
    }
    return found;
  }

  // (3, N) rows of whole steps as x y z, metres
  function woven(array) {
    const points = new Float32Array(3 * array.columns);
    for (let k = 0; k < 3; k++) {
      const row = array.row(k);
      for (let i = 0; i < array.columns; i++) points[3 * i + k] = data.step * row[i];
    }
    return points;
  }

  function facesAt(points, track, position) {
    const base = arrays.base, parts = arrays[`${track.name}_parts`], n = base.columns;
    const a = Math.floor(position), b = Math.min(a + 1, track.stops.length - 1), t = position - a;
    for (let k = 0; k < 3; k++) {
      const row = base.row(k);
      for (let i = 0; i < n; i++) points[3 * i + k] = row[i];
    }
    for (let part = 0; part < parts.rows / 3; part++) {
      const weight = track.weights[a][part] * (1 - t) + track.weights[b][part] * t;
      for (let k = 0; k < 3; k++) {
        const row = parts.row(3 * part + k);
        for (let i = 0; i < n; i++) points[3 * i + k] += weight * row[i];
      }
    }
    for (let i = 0; i < points.length; i++) points[i] *= data.step;
  }

  function normalsOf(points, triangles, normals) {
    normals.fill(0);
    for (let i = 0; i < triangles.length; i += 3) {
      const a = 3 * triangles[i], b = 3 * triangles[i + 1], c = 3 * triangles[i + 2];
      const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
      const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
      const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx; // weighted by area
      for (const p of [a, b, c]) {
        normals[p] += nx;
        normals[p + 1] += ny;
        normals[p + 2] += nz;
      }
    }
  }

  // ---- WebGL --------------------------------------------------------------------------------------------------------
  const VERTEX = `
    attribute vec3 point, normal, truth;
    attribute vec4 colour; // sRGB, and how open the surface is
    attribute float measured;
    uniform mat3 turn;
    uniform vec3 pivot;
    uniform vec2 half_size;
    varying vec3 v_normal;
    varying vec4 v_colour;
    varying float v_gap, v_measured;
    void main() {
      vec3 seen = turn * (point - pivot);
      v_normal = turn * normal;
      v_colour = colour;
      v_gap = 1000.0 * distance(point, truth);
      v_measured = measured;
      gl_Position = vec4(seen.xy / half_size, -seen.z / 0.4, 1.0); // parallel rays: perspective is the photo's alone
    }`;
  const fragment = (n, colours) => `
    precision highp float;
    uniform vec3 towards[${n}], light[${n}], rest;
    uniform float ambient, occlusion, largest, grey;
    uniform bool values;
    uniform sampler2D legend;
    varying vec3 v_normal;
    varying vec4 v_colour;
    varying float v_gap, v_measured;
    vec3 linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
    vec3 shown(vec3 c) { return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
    void main() {
      vec3 n = normalize(v_normal);
      vec3 colour;
      if (!gl_FrontFacing) {
        colour = vec3(0.42); // a cut surface, never a look into the empty head
      } else if (values) {
        vec3 value = texture2D(legend, vec2(clamp(v_gap / largest, 0.0, 1.0) * ${colours - 1}.0 / ${colours}.0 + 0.5 / ${colours}.0, 0.5)).rgb;
        float turned = 1.0 - clamp(n.z, 0.0, 1.0);
        colour = mix(rest, value, v_measured) * (1.0 - 0.42 * pow(turned, 1.6));
      } else {
        vec3 skin = mix(v_colour.rgb, vec3(dot(v_colour.rgb, vec3(0.3, 0.59, 0.11))), grey);
        vec3 sum = vec3(ambient);
        for (int i = 0; i < ${n}; i++) sum += light[i] * max(dot(n, towards[i]), 0.0);
        colour = shown(clamp(linear(skin) * pow(v_colour.a, occlusion) * sum / 3.14159265, 0.0, 1.0));
      }
      gl_FragColor = vec4(colour, 1.0);
    }`;

  function program(gl) {
    const made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment(data.lights.length, data.legend.colours.length)]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    gl.useProgram(made);
    return made;
  }

  function makeDrawer() {
    const gl = canvas.getContext("webgl", { antialias: true, alpha: true });
    if (!gl) throw new Error("no WebGL");
    const wide = arrays.truth.columns > 65535;
    if (wide && !gl.getExtension("OES_element_index_uint")) throw new Error("too many vertices for this browser");
    const made = program(gl), n = arrays.truth.columns;
    const triangles = new (wide ? Uint32Array : Uint16Array)(3 * arrays.faces.columns);
    for (let k = 0; k < 3; k++) arrays.faces.row(k).forEach((vertex, i) => { triangles[3 * i + k] = vertex; });
    const truth = woven(arrays.truth), points = new Float32Array(3 * n), normals = new Float32Array(3 * n);
    const colours = new Uint8Array(4 * n);
    for (let k = 0; k < 4; k++) arrays.colours.row(k).forEach((value, i) => { colours[4 * i + k] = value; });

    const buffer = (values, target = gl.ARRAY_BUFFER, use = gl.STATIC_DRAW) => {
      const id = gl.createBuffer();
      gl.bindBuffer(target, id);
      gl.bufferData(target, values, use);
      return id;
    };
    buffer(triangles, gl.ELEMENT_ARRAY_BUFFER);
    const shared = { colour: [buffer(colours), 4, gl.UNSIGNED_BYTE, true], truth: [buffer(truth), 3, gl.FLOAT, false],
      measured: [buffer(arrays.measured.row(0)), 1, gl.UNSIGNED_BYTE, false] };
    normalsOf(truth, triangles, normals);
    const heads = [[shared.truth[0], buffer(normals)],
      [buffer(points, gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW), buffer(normals, gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW)]];
    const feed = (name, [id, size, type, whole]) => {
      const place = gl.getAttribLocation(made, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, id);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, whole, 0, 0);
    };
    for (const name of Object.keys(shared)) feed(name, shared[name]);

    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, data.legend.colours.length, 1, 0, gl.RGB, gl.UNSIGNED_BYTE,
      new Uint8Array(data.legend.colours.flat()));
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, name, value);

    const place = (name) => gl.getUniformLocation(made, name);
    const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    gl.uniform3fv(place("towards"), data.lights.flatMap(([way]) => way.map((x) => x / Math.hypot(...way))));
    gl.uniform3fv(place("light"), data.lights.flatMap(([, colour, strength]) => colour.map((c) => strength * linear(c / 255))));
    gl.uniform3fv(place("rest"), data.legend.rest.map((c) => c / 255));
    gl.uniform3fv(place("pivot"), data.pivot);
    gl.uniform1f(place("ambient"), data.ambient);
    gl.uniform1f(place("occlusion"), data.occlusion);
    gl.uniform1f(place("largest"), data.legend.mm);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.SCISSOR_TEST);

    let shaped = "";
    function shape(track, position) {
      if (shaped === `${track.name} ${position}`) return;
      shaped = `${track.name} ${position}`;
      facesAt(points, track, position);
      normalsOf(points, triangles, normals);
      [points, normals].forEach((values, i) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, heads[1][i]);
        gl.bufferSubData(gl.ARRAY_BUFFER, 0, values);
      });
    }

    function draw(track, position, view, difference) {
      const density = Math.min(window.devicePixelRatio || 1, 2);
      const width = Math.round(canvas.clientWidth * density), height = Math.round(canvas.clientHeight * density);
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      shape(track, position);
      const each = Math.floor(width / 2);
      const scale = Math.min(each / (2 * data.half[0]), height / (2 * data.half[1])); // pixels a metre
      for (const bar of document.querySelectorAll(".bars i")) bar.style.width = `${0.05 * scale / density}px`;
      const a = view.azimuth * Math.PI / 180, e = view.elevation * Math.PI / 180;
      const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
      // By columns: rows are the viewer's right, up, and the way to the viewer
      gl.uniformMatrix3fv(place("turn"), false, [ca, -sa * se, sa * ce, 0, ce, se, -sa, -ca * se, ca * ce]);
      gl.uniform2f(place("half_size"), each / (2 * scale), height / (2 * scale));
      heads.forEach(([point, normal], i) => {
        gl.viewport(i * each, 0, each, height);
        gl.scissor(i * each, 0, each, height);
        gl.clearColor(0, 0, 0, 0);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.uniform1i(place("values"), i === 1 && difference);
        gl.uniform1f(place("grey"), i === 1 && track.stops[Math.round(position)].grey ? 1 : 0);
        feed("point", [point, 3, gl.FLOAT, false]);
        feed("normal", [normal, 3, gl.FLOAT, false]);
        gl.drawElements(gl.TRIANGLES, triangles.length, wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT, 0);
      });
      canvas.dataset.drawn = shaped; // what is on the screen, for who looks from outside
    }
    return { draw };
  }

  function begin() {
    try {
      drawer = makeDrawer();
    } catch (error) {
      failed(error);
    }
    show();
  }

  function failed(error) {
    console.warn(`faceambig: ${error.message}`);
    at("failed").hidden = false;
    canvas.hidden = true;
  }

  coloured();
  show();
  unpack(at("geometry").textContent).then((found) => {
    arrays = found;
    begin();
    new ResizeObserver(redraw).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", begin);
  }).catch(failed);
})();
