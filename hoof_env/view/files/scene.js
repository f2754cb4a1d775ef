// Draws rows of numbers into the glyphs of a scene, and writes the numbers of a page.

const find = (what) => document.querySelector(what)
const all = (what) => [...document.querySelectorAll(what)]
const calm = window.matchMedia("(prefers-reduced-motion: reduce)")
const CALM = 250 // time between two pictures with reduced motion [ms]

const show_number = (value, digits) =>
  Number.isFinite(value) ? (Object.is(value, -0) ? 0 : value).toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1") : "–"

class SceneView {
  constructor(parts, root = document) {
    this.parts = parts
    this.root = root
    this.zoom = 1
    this.follows = true
    this.place = null
    this.cells = parts.numbers.map(([key]) => [...root.querySelectorAll(`[data-number="${key}"]`)])
    const again = () => this.aim()
    const {inner_width, inner_height} = parts.figure.properties
    for (const property of [inner_width, inner_height]) {
      parts.figure.connect(property.change, again)
    }
  }

  show(numbers) {
    const row = Float64Array.from(numbers)
    const sources = this.parts.sources
    for (const [name, column, start, pieces, length] of this.parts.places) {
      const data = sources[name].data
      if (pieces == 0) {
        data[column] = row.subarray(start, start + length)
      } else {
        data[column] = Array.from({length: pieces}, (_, k) =>
          row.subarray(start + k * length, start + (k + 1) * length))
      }
    }
    for (const source of Object.values(sources)) {
      source.change.emit()
    }
    if (this.follows || this.place == null) {
      this.place = [row[1], row[2]]
    }
    this.aim()
    this.write(row)
  }

  // Paths of toe and heel in the last second of the curves.
  trace(curves) {
    const {paths} = this.parts
    if (curves.time.length == 0) {
      return
    }
    const end = curves.time.at(-1)
    const start = curves.time.findLastIndex((time) => time < end - 1) + 1
    const near = (_, k) => k % 4 == 0  // a path of eight milliseconds a piece looks the same
    const last = Object.keys(paths.data).map((name) => [name, curves[name].slice(start).filter(near)])
    paths.setv({data: Object.fromEntries(last)}, {sync: false})
  }

  write(row) {
    const head = this.parts.head
    this.parts.numbers.forEach(([_, digits], k) => {
      const text = show_number(row[head + k], digits)
      for (const cell of this.cells[k]) {
        if (cell.textContent != text) {
          cell.textContent = text
        }
      }
    })
  }

  // The ground keeps its place; all else follows from the shape of the figure. Ranges are the page's own
  // business: they are not sent to a server.
  aim() {
    const figure = this.parts.figure
    const camera = this.parts.camera
    const [low, high, wide] = ["low", "high", "wide"].map((name) => camera[name])
    const width = figure.inner_width || 1
    const height = figure.inner_height || 1
    if (this.place == null) {
      return
    }
    const [x, level] = this.place
    const metres = Math.max(high - low, (2 * wide * height) / width) / this.zoom
    const bottom = level + low / this.zoom
    const half = (metres * width) / height / 2
    const hidden = {sync: false}
    figure.x_range.setv({start: x - half, end: x + half}, hidden)
    figure.y_range.setv({start: bottom, end: bottom + metres}, hidden)
  }
}

// Buttons and the check box that only change how the scene is seen.
function bind_camera(views) {
  const change = (factor) => {
    for (const view of views) {
      view.zoom = Math.min(Math.max(view.zoom * factor, 0.4), 8)
      view.aim()
    }
  }
  find("[data-zoom=in]").addEventListener("click", () => change(1.25))
  find("[data-zoom=out]").addEventListener("click", () => change(0.8))
  find("[data-follow]")?.addEventListener("change", (event) => {
    for (const view of views) {
      view.follows = event.target.checked
    }
  })
}

// Keys of a page, except in fields, and those that a focused control takes itself: space on buttons, arrows on
// sliders.
function bind_keys(acts) {
  document.addEventListener("keydown", (event) => {
    const {key, target} = event
    const is_slider = target.type == "range"
    const is_field = /^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName) && !is_slider
    const is_taken = key == " " ? /^(BUTTON|SUMMARY)$/.test(target.tagName) : key.startsWith("Arrow") && is_slider
    if (key in acts && !is_field && !is_taken && !event.ctrlKey && !event.metaKey && !event.altKey) {
      event.preventDefault()
      acts[key]()
    }
  })
}
