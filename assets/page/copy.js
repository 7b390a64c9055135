// ---- clipboard ------------------------------------------------------------------------------------------------------------
readers.copy = ({ text, n, link }) => copy(link ? `${location.origin}/${text && "?" + text}` : text, n);

async function copy(text, n) {
  let ok = true;
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    ok = copyOldWay(text); // refused, or a page that did not come from this machine
  }
  if (!ok) offer(text);
  report("copied", { n, ok });
}

function copyOldWay(text) {
  const focused = document.activeElement;
  const area = document.createElement("textarea");
  area.value = text;
  area.setAttribute("aria-hidden", "true");
  area.style.cssText = "position: fixed; opacity: 0";
  document.body.append(area);
  area.select();
  let ok = false;
  try {
    ok = document.execCommand("copy");
  } finally {
    area.remove();
    focused?.focus?.({ preventScroll: true });
  }
  return ok;
}

// The last way: the text stands selected, and the person copies it.
function offer(text) {
  const box = document.createElement("dialog");
  box.className = "fa-copy";
  const label = document.createElement("label");
  label.textContent = words.copy;
  const field = document.createElement("input");
  field.readOnly = true;
  field.value = text;
  label.append(field);
  const close = document.createElement("button");
  close.textContent = words.close;
  close.addEventListener("click", () => box.close());
  box.append(label, close);
  box.addEventListener("close", () => box.remove());
  document.body.append(box);
  box.showModal();
  field.select();
}

function copied(event) {
  const element = event.target.closest?.("[data-fa-copy]");
  if (element) copy(element.dataset.faCopy, 0);
  return element;
}

document.addEventListener("click", copied);
document.addEventListener("keydown", (event) => {
  if (event.key !== "Enter" && event.key !== " ") return;
  if (event.target.matches?.("button, a[href]")) return; // it clicks by itself
  if (copied(event)) event.preventDefault();
});

function nameCopies() {
  for (const element of document.querySelectorAll("[data-fa-copy]:not(button, a[href], [tabindex])")) {
    element.tabIndex = 0;
    set(element, "role", "button");
  }
}
