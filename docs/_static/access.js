// Names, and places in the order of the keyboard, that theme and gallery leave out; wide figures on narrow screens.
const scrolls = (element, name) => {
  element.tabIndex = 0;
  element.setAttribute("role", "region");
  element.setAttribute("aria-label", name);
};
document.addEventListener("DOMContentLoaded", () => {
  for (const toggle of document.querySelectorAll("summary:has(.toctree-toggle)")) {
    toggle.setAttribute("aria-label", `Pages below ${toggle.closest("li").querySelector("a").textContent.trim()}`);
  }
  for (const button of document.querySelectorAll(".search-button-field")) {
    button.setAttribute("aria-label", button.textContent.trim().replace(/\s+/g, " "));
  }
  for (const diagram of document.querySelectorAll(".method-diagram")) scrolls(diagram, "Diagram of the method");
  if (!matchMedia("(max-width: 700px)").matches) return;
  for (const picture of document.querySelectorAll(".bd-article img:not(.sphx-glr-thumbcontainer img, .sd-card img, .only-narrow img)")) {
    const frame = document.createElement("div"), shown = picture.closest("a") ?? picture;
    frame.className = "wide-figure";
    shown.replaceWith(frame);
    frame.append(shown);
    scrolls(frame, `Figure: ${picture.alt}`);
  }
});
