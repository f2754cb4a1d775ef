// Frames of pages that play are as high as what is in them.
for (const frame of document.querySelectorAll("iframe.playback")) {
  const fit = () => {
    const inside = frame.contentDocument?.documentElement
    if (inside) {
      frame.style.height = `${inside.querySelector(".alone")?.scrollHeight ?? inside.scrollHeight}px`
    }
  }
  frame.addEventListener("load", () => {
    fit()
    new ResizeObserver(fit).observe(frame)
  })
}
