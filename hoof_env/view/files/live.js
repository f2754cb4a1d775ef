// The live page: shows what the server sends, and sends what the controls ask.

const view = new SceneView(parts)
const hidden = {sync: false}
let asks = 0
let going = true

function ask(name, more = {}) {
  asks += 1
  wire.asked = {name, ...more, count: asks}
}

// States

// The first news of a page and those after a jump in time replace what it has.
function take() {
  const numbers = Float64Array.from(wire.news)
  const [anew, ...counts] = numbers
  let at = 3
  const next = (length) => {
    at += length
    return numbers.subarray(at - length, at)
  }
  row = next(row_length)
  Object.values(masters).forEach(({source, most}, k) => {
    const names = Object.keys(source.data)
    const columns = Object.fromEntries(names.map((name) => [name, next(counts[k])]))
    if (anew) {
      source.setv({data: columns}, hidden)
    } else if (counts[k] > 0) {
      source.stream(columns, most, hidden)
    }
  })
  if (anew || counts[0] > 0) {
    is_longer = true
    queue_curves()
  }
}

let row = []
let is_longer = false

function show_frame() {
  if (is_longer) {
    is_longer = false
    view.trace(masters.curves.source.data)
  }
  view.show(row)
  const scrub = find("[data-ask=back]")
  if (going) {
    scrub.max = row[0].toFixed(2)
    scrub.min = Math.max(0, row[0] - 30).toFixed(2)
    scrub.value = scrub.max
  }
  find("#at").textContent = `${row[0].toFixed(2)} s`
}

// States that come faster than the browser paints are not drawn: the last one is.
let is_new = false

wire.connect(wire.properties.news.change, () => {
  is_new = true
  take()
  document.body.dataset.states = String(Number(document.body.dataset.states ?? 0) + 1)
})

// Figures take their turns, one in each frame of the browser: to paint all at once would make it stutter.
const turns = []

function refresh({source, window: range, master}) {
  const {data} = masters[master].source
  const end = Math.max(masters.curves.source.data.time.at(-1) ?? 0, seconds)
  // Bokeh warns of axes without data, as after the start of an episode.
  const columns = Object.keys(source.data).map((name) => [name, data[name].length > 0 ? data[name] : [0]])
  // Columns may be the same arrays, in which other numbers stand.
  source.setv({data: Object.fromEntries(columns)}, {sync: false, check_eq: false})
  range.setv({start: end - seconds, end}, hidden)
}

function refresh_bars() {
  const end = parts.head + parts.numbers.length
  const total = [...row.slice(end - bars.data.term.length, end)]
  bars.setv({data: {...bars.data, total}}, hidden)
}

const refreshes = [...shown.map((figure) => () => refresh(figure)), refresh_bars]

function queue_curves() {
  for (const act of refreshes) {
    if (!turns.includes(act)) {
      turns.push(act)
    }
  }
}

// Messages

const READING = 10_000 // time for which an error stands [ms]
let said = 0

function hear() {
  const message = wire.told
  if (message.go != null) {
    window.location.assign(message.go)
    return
  }
  // The end of an episode, which may last a second, does not wipe away why something was refused.
  const status = find("#status")
  const is_read = status.dataset.kind == "note" || performance.now() - said > READING
  if (message.status != null && (message.kind != "end" || is_read)) {
    said = performance.now()
    status.textContent = message.status
    status.dataset.kind = message.kind == "end" ? "note" : message.kind
  }
  if (message.playing != null) {
    going = message.playing
    const button = find("[data-ask=play]")
    button.textContent = going ? "Pause" : "Play"
    button.setAttribute("aria-pressed", String(going))
  }
  if (message.span != null) {
    const scrub = find("[data-ask=back]")
    scrub.min = message.span[0].toFixed(2)
    scrub.max = message.span[1].toFixed(2)
  }
  if (message.recording != null) {
    const button = find("[data-ask=record]")
    button.textContent = message.recording ? "Stop and write" : "Record"
    button.setAttribute("aria-pressed", String(message.recording))
  }
  if (message.hand != null) {
    find("[data-ask=release]").disabled = !message.hand
  }
}

wire.connect(wire.properties.told.change, hear)

// Controls

const number_of = (text) => (text == "" ? null : Number(text))
const value_of = (input) => (input.dataset.log != null ? 10 ** Number(input.value) : Number(input.value))

function write_output(input, value = value_of(input)) {
  const output = input.closest(".slider")?.querySelector("output")
  if (output != null) {
    const own = value * Number(input.dataset.scale ?? 1)
    const text = String(Number(own.toPrecision(4)))
    output.textContent = `${text} ${input.dataset.unit ?? ""}`.trim()
    input.setAttribute("aria-valuetext", output.textContent)
  }
}

function throttled(act, wait = 60) {
  let last = 0
  let timer = null
  return () => {
    clearTimeout(timer)
    const late = performance.now() - last - wait
    const go = () => {
      last = performance.now()
      act()
    }
    if (late >= 0) {
      go()
    } else {
      timer = setTimeout(go, -late)
    }
  }
}

for (const input of all("input[type=range][data-ask]")) {
  const more = input.dataset.name != null ? {setting: input.dataset.name} : {}
  const send = throttled(() => ask(input.dataset.ask, {...more, value: value_of(input)}))
  input.addEventListener("input", () => {
    if (input.dataset.ask == "back") {
      going = false  // at once, or states that are under way would move the slider under the hand
    }
    write_output(input)
    if (input.dataset.late == null) {
      send()
    }
  })
  input.addEventListener("change", send)
  // Its place is at the nearest notch, which the present value need not be.
  write_output(input, Number(input.dataset.now ?? input.value))
}

for (const button of all("button[data-ask]")) {
  button.addEventListener("click", () => {
    const name = button.dataset.ask
    if (name == "record") {
      ask(name, {suffix: find("#format").value})
    } else if (name == "reset") {
      ask(name, {seed: number_of(find("#seed").value), policy: find("#policy").value})
    } else if (name == "push") {
      ask(name, {value: number_of(find("#impulse").value)})
    } else {
      ask(name, button.dataset.value != null ? {value: button.dataset.value} : {})
    }
  })
}

find("#setup").addEventListener("submit", (event) => {
  event.preventDefault()
  const given = Object.fromEntries(new FormData(event.target).entries())
  ask("setup", {...given, seed: number_of(given.seed)})
})

bind_camera([view])

bind_keys({" ": () => ask("play"), ".": () => ask("step"), "r": () => ask("reset")})

if (window.matchMedia("(max-width: 760px)").matches) {
  for (const group of all("aside details")) {
    group.open = false
  }
}

// Frames of the browser; their number is there to be measured. With reduced motion there are four pictures a
// second while it plays.
let is_turn = false
let painted = 0

const count = (now) => {
  document.body.dataset.frames = String(Number(document.body.dataset.frames ?? 0) + 1)
  // A figure has its turn in a frame without a new scene, or where each has one, in every other.
  is_turn = !is_turn || !is_new
  const is_due = !(calm.matches && going) || now - painted > CALM
  if (is_new && is_due) {
    is_new = false
    painted = now
    show_frame()
  }
  if (is_turn && turns.length > 0) {
    turns.shift()()
  }
  requestAnimationFrame(count)
}
take()
requestAnimationFrame(count)
show_frame()
// A policy may have failed before the page was there.
hear()
// Numbers that came while the page was made are not there yet.
ask("show")
document.body.dataset.ready = "true"
