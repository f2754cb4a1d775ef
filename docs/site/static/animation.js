// An animation can be stopped: a button swaps it for a picture of the frame that is seen.
const still = matchMedia("(prefers-reduced-motion: reduce)").matches
for (const film of document.querySelectorAll('article img[src$=".gif"]')) {
  const stage = document.createElement("span")
  const button = document.createElement("button")
  const frame = document.createElement("canvas")
  stage.className = "animation"
  button.type = "button"
  film.replaceWith(stage)
  stage.append(film, frame, button)
  const show = (moving) => {
    if (!moving) {
      frame.width = film.naturalWidth
      frame.height = film.naturalHeight
      frame.getContext("2d").drawImage(film, 0, 0)
    }
    film.hidden = !moving
    frame.hidden = moving
    button.textContent = moving ? "Pause" : "Play"
  }
  button.addEventListener("click", () => show(film.hidden))
  show(true)
  if (still) film.complete ? show(false) : film.addEventListener("load", () => show(false), { once: true })
}
