// MathJax 4.1.3 and what it needs of its fonts (npm: mathjax, @mathjax/mathjax-newcm-font; Apache License 2.0, see LICENSE)
// come with the site, so that no page needs a network.
window.MathJax = {
  tex: { inlineMath: [["\\(", "\\)"]] },
  options: {
    enableMenu: false, enableSpeech: false, enableBraille: false, enableEnrichment: false, enableExplorer: false,
    menuOptions: { settings: { speech: false, braille: false, enrich: false, assistiveMml: true } },
  },
  output: { font: "mathjax-newcm", fontPath: "[mathjax]/%%FONT%%" },
  // An equation that is wider than the screen can be scrolled by keys.
  startup: {
    pageReady: async () => {
      await MathJax.startup.defaultPageReady();
      for (const equation of document.querySelectorAll("mjx-container[display]")) {
        if (equation.scrollWidth > equation.clientWidth) equation.tabIndex = 0;
      }
    },
  },
};
