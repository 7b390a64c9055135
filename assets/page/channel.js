// Our part of the page. guard/page.py joins assets/page/*.js into one function and one inline script before viser's
// own; nothing is evaluated. It leans on names of viser 1.1.1: window.__viserMutable, window.__viserSceneTree, the
// messages of its worker and the shape of a labelled row of its panel.
//
// Server -> page: hidden elements <div hidden data-faceambig="KIND" data-json="VALUE"> in the content of `add_html`,
// read when the message comes, whether or not its panel is open. guard/data.py and script.py write them.
//   title      text of the browser's tab
//   pressed    {label of a button group: option that is on}
//   valuetext  {label of a slider: what a screen reader says for its number}
//   icons      {viser's icon: name of the buttons that show it}
//   words      {lost, back, no_webgl, copy, close, number}: what this script itself says; the first ones come with the page
//   lang       language of the page
//   report     {uuid}: the text control that takes reports; it is answered by "hello"
//   address    {query}: what the address bar shows after "/?"; never a new entry of the history
//   copy       {text, n, link}: to the clipboard, once for each n, answered by "copied"; a link: text is its query
//   blink      {nodes, seconds}: one of these nodes is drawn at a time, `seconds` each; no nodes end it
//   theme      {theme: auto | light | dark, text: 1 to 2}: kept in localStorage
//   probe      {on}: whether the colours of a head are numbers, which the pointer may ask for
//   probed     {n, text}: the answer to question n, shown where it was asked until the next change; "": none any more
//   keys       {on}: whether keys without Ctrl, Alt or Meta are shortcuts
// In what a panel shows:
//   data-fa-copy="TEXT"                   a click, Enter or Space copies the text
//   data-fa-host                          an element in which the page's own host and port are written
//   data-fa-step                          lesson and step: brought into view when it changes
//   data-fa-spoken                        its text is said to a screen reader, SILENCE after it changed last
//   data-fa-photo="WIDTHxHEIGHT"          an element whose box shows a photograph of so many pixels
//   data-fa-view="X,Y,WIDTH,HEIGHT"       on it: the part in the box, in pixels of the photograph; else all of it
//   data-fa-place="1"                     on it: a click places a point
//   data-fa-ask="1"                       what to place: it comes into view when placing begins
//   <g data-fa-point="INDEX" data-fa-at="X,Y">  in an SVG in it: a point that a hand or arrow keys move
//
// Page -> server: one JSON object of one key as the value of the text control; script.py reads them. Pixels count from
// the upper left corner of the photograph, like the coordinates of its SVG.
//   hello   {query, reduced_motion, touch, dark, theme, text, languages}: at every connection; theme and text as kept, or null
//   point   {index, x, y, done}: a point moves, at most every 50 ms; done: it has been let go
//   click   {x, y}: a place on a photograph with data-fa-place
//   gone    index: Delete on a point
//   key     "Escape"
//   hand    true: a hand is turning the viewer
//   probe   {n, head, vertex}: the pointer is over this vertex of this head; n counts the questions
//   dark    whether the system is dark, when that changes
//   copied  {n, ok}: n is 0 for data-fa-copy

const readers = Object.create(null); // kind of data -> what is done with its value; each part adds its own
const onConnection = []; // each is told whether there is a connection
const holds = []; // each is shown what viser sends, and says whether it keeps that for later
const words = {};
const newest = {}; // kind -> what came last: the server repeats what is, and that is no new wish
let socket = null; // viser's worker that speaks with the server, while it is connected
let reports = null; // identifier of the text control

function read({ dataset: { faceambig: kind, json } }) {
  if (newest[kind] === json) return;
  newest[kind] = json;
  try {
    readers[kind]?.(JSON.parse(json));
  } catch (error) {
    console.error(`data "${kind}":`, error);
  }
}

function readContent(content) {
  if (typeof content !== "string" || !content.includes("data-faceambig")) return;
  const parsed = new DOMParser().parseFromString(content, "text/html");
  for (const element of parsed.querySelectorAll("[data-faceambig]")) read(element);
}

// viser's panels draw no content while they are folded, so data are read from its messages: those of `add_html` alone.
const htmls = new Set(); // their identifiers
function hear({ data }) {
  if (data?.type === "message_batch") {
    for (const { type, uuid, props, updates } of data.messages) {
      if (type === "GuiHtmlMessage") htmls.add(uuid);
      if (htmls.has(uuid)) readContent(props?.content ?? updates?.content);
    }
    watchScene(); // it may have come without a change of the document
  } else if (data?.type === "connected" || data?.type === "closed") {
    socket = data.type === "connected" ? this : null;
    reports = null; // of the next connection: another one
    htmls.clear();
    for (const kind of Object.keys(newest)) delete newest[kind];
    for (const tell of onConnection) tell(socket !== null);
  }
}

window.Worker = class extends window.Worker {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", hear);
  }

  postMessage(message, ...rest) {
    if (!holds.some((hold) => hold(message))) super.postMessage(message, ...rest);
  }
};

// Past viser's sender of control values, which keeps only the newest of each control for 50 ms.
function report(kind, value) {
  if (socket === null || reports === null) return;
  const message = { type: "GuiUpdateMessage", uuid: reports, updates: { value: JSON.stringify({ [kind]: value }) } };
  socket.postMessage({ type: "send", message });
}

readers.words = (value) => Object.assign(words, value);
