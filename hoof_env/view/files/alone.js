// A page that stands alone: plays records that it has.

const scenes = views.map(({parts}, k) => new SceneView(parts, find(`[data-record="${k}"]`)))
const counts = views.map(({count}) => count)
const longest = Math.max(...counts)
const slider = find("#at")
const play = find("#play")
let at = 0
let playing = false
let last = 0

slider.max = String(longest - 1)

function show() {
  views.forEach(({rows, count}, k) => {
    const row = Math.min(Math.round(at), count - 1)
    const {row: numbers} = rows.data
    const length = numbers.length / count
    scenes[k].show(Array.prototype.slice.call(numbers, row * length, (row + 1) * length))
  })
  const time = begin + Math.round(at) * step
  for (const cursor of cursors) {
    cursor.location = time
  }
  slider.value = String(Math.round(at))
  slider.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`)
  find("output[for=at]").textContent = `${time.toFixed(2)} s`
}

function set_playing(value) {
  playing = value
  play.textContent = playing ? "Pause" : "Play"
  play.setAttribute("aria-pressed", String(playing))
  if (playing) {
    last = performance.now()
    requestAnimationFrame(go)
  }
}

function go(now) {
  if (!playing) {
    return
  }
  const passed = now - last
  if (passed >= (calm.matches ? CALM : 30)) {
    last = now
    at += (Math.min(passed, 500) / 1000) * Number(find("#speed").value) / step
    if (at > longest - 1) {
      at = 0
    }
    show()
  }
  requestAnimationFrame(go)
}

function move(steps) {
  set_playing(false)
  at = Math.min(Math.max(Math.round(at) + steps, 0), longest - 1)
  show()
}

play.addEventListener("click", () => set_playing(!playing))
slider.addEventListener("input", () => {
  set_playing(false)
  at = Number(slider.value)
  show()
})
bind_camera(scenes)
bind_keys({
  " ": () => set_playing(!playing),
  "ArrowRight": () => move(1),
  "ArrowLeft": () => move(-1),
  "Home": () => move(-longest),
})
show()
document.body.dataset.ready = "true"
