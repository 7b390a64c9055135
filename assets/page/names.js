// ---- names --------------------------------------------------------------------------------------------------------------
const pressed = {}; // label of a button group -> the option that is on
const valuetext = {}; // label of a slider -> its value in words
const icons = {}; // viser's icon -> name of the button that shows it
readers.title = (value) => (document.title = value);
readers.lang = (value) => (document.documentElement.lang = value);
for (const [kind, known] of Object.entries({ pressed, valuetext, icons })) {
  readers[kind] = (value) => {
    Object.assign(known, value);
    nameControls();
  };
}

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
    if (thumbs.length) {
      set(field, "role", "group"); // of a slider and its number box
      set(field, "aria-label", name);
    }
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
  for (const cross of document.querySelectorAll(".mantine-Notification-closeButton")) {
    set(cross, "aria-label", words.close);
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
