
// Values of a drawing, read from its CSV: of the row nearest to the pointer or finger, or of the one that the slider is at.
const cellsOf = (line) =>
  [...line.matchAll(/(?:^|,)("(?:[^"]|"")*"|[^,]*)/g)].map(([, cell]) => cell.replace(/^"|"$/g, "").replaceAll('""', '"'));
for (const drawing of document.querySelectorAll(".readable")) {
  const part = (name) => drawing.querySelector(name);
  const [picture, mark, slider, output] = [".picture", ".mark", "input", "output"].map(part);
  const [x, y] = ["x", "y"].map((name) => drawing.dataset[name]?.split(" ").map((share) => share / 1000));
  const address = part("a").href;
  const [names, ...rows] = decodeURIComponent(address.slice(address.indexOf(",") + 1)).trimEnd().split("\n").map(cellsOf);
  const show = (row) => {
    output.textContent = rows[row].map((cell, number) => `${names[number]}: ${cell || "none"}`).join("; ");
    slider.value = row;
    slider.setAttribute("aria-valuetext", output.textContent);
    mark.style.left = `${100 * x[row]}%`;
    if (y) mark.style.top = `${100 * y[row]}%`;
    mark.hidden = false;
  };
  const showNearest = (event) => {
    const box = picture.getBoundingClientRect();
    const away = (row) =>
      Math.hypot(x[row] * box.width + box.left - event.clientX, y ? y[row] * box.height + box.top - event.clientY : 0);
    show(rows.reduce((best, _, row) => (away(row) < away(best) ? row : best), 0));
  };
  picture.addEventListener("pointerdown", showNearest);
  picture.addEventListener("pointermove", showNearest);
  slider.addEventListener("input", () => show(Number(slider.value)));
  slider.hidden = false;
}
