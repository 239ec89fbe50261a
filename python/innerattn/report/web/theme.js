// Light or dark, for a page and the pages in its frames; a frame becomes as high as its page, or as styles allow.

/** Begins with what the system prefers; `changed` draws anew what does not follow by itself. */
function startTheme(changed = () => {}) {
  const button = $("theme"), root = document.documentElement, isFramed = parent !== window;
  const frames = () => [...document.querySelectorAll("iframe")];
  const setTheme = (theme) => {
    root.dataset.theme = theme;
    button.setAttribute("aria-pressed", String(theme === "dark"));
    for (const frame of frames()) frame.contentWindow.postMessage({ theme }, "*");
    changed();
  };
  const tellHeight = () => parent.postMessage({ height: root.offsetHeight }, "*");
  addEventListener("message", ({ source, data }) => {
    const frame = frames().find((one) => one.contentWindow === source);
    if (frame && data?.height > 0) {
      frame.style.height = `${Math.ceil(data.height) + frame.offsetHeight - frame.clientHeight}px`;
      source.postMessage({ theme: root.dataset.theme }, "*");
    }
    if (!isFramed || source !== parent || !["light", "dark"].includes(data?.theme)) return;
    if (data.theme !== root.dataset.theme) setTheme(data.theme);
    if (button.hidden) return;
    button.hidden = true; // the page around this one has its own
    tellHeight();
  });
  button.addEventListener("click", () => setTheme(root.dataset.theme === "dark" ? "light" : "dark"));
  setTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  if (!isFramed) return;
  root.dataset.framed = "true";
  new ResizeObserver(tellHeight).observe(root);
}
