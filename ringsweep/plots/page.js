// Shows the variable and the slice that are chosen: when the page is loaded, and after each choice.
function unpacked(bytes) {
  const count = bytes.length / 3, bits = new Int32Array(count)
  let sum = 0
  for (let i = 0; i < count; i++) {
    const step = bytes[i] | bytes[count + i] << 8 | bytes[2 * count + i] << 16
    sum += step % 2 ? -(step + 1) / 2 : step / 2
    bits[i] = sum << 9
  }
  return new Float32Array(bits.buffer)
}
for (const [key, packed] of Object.entries(cells)) if (packed instanceof Uint8Array) cells[key] = unpacked(packed)

const name = variable.value, about = variables[name], words = about.words, values = cells[name]
let first = 0
for (const chooser of slices) first = first * chooser.options.length + Number(chooser.value)
const slice = first
first *= size

function shown(i) {
  const value = values[first + i]
  return words !== null && value < 0 ? NaN : value
}
function number(value) {
  return String(Number(value.toPrecision(4))).replace(/-/g, "\u2212")
}
function percent(share) {
  if (share > 0 && share < 0.001) return "< 0.1 %"
  return share > 0.999 && share < 1 ? "> 99.9 %" : `${(100 * share).toFixed(1)} %`
}
function upwards(bound) {
  const unit = 10 ** (Math.floor(Math.log10(bound)) - 1)
  return bound === 0 ? 0 : Number((Math.ceil(bound / unit) * unit).toPrecision(2))
}
function word(key, i) {
  return variables[key]?.words?.[cells[key][first + i]]
}

// The values, in the places of the view, and their colours.
const colours = bars[name][0].color_mapper, scale = about.logarithmic ? Math.log10 : value => value
const target = edges === null ? view.data.value : view.data.value[0]
const cellAt = pixel => rows[Math.floor(pixel / columns.length)] + columns[pixel % columns.length]
for (let pixel = 0; pixel < target.length; pixel++) target[pixel] = scale(shown(cellAt(pixel)))
paint.setv({palette: colours.palette, low: scale(colours.low), high: scale(colours.high)})
paint.change.emit()
view.change.emit()

// A classification has the share of each class beside its colour.
// On a narrow screen the colour bar stands below the plot, whose width it would take.
const narrow = window.innerWidth < 600
for (const [key, pair] of Object.entries(bars)) {
  pair.forEach((bar, k) => { bar.visible = key === name && (words !== null || line === null) && narrow === (k === 1) })
}
if (narrow) for (const axis of axes) axis.axis_label_text_font_size = "11px"
for (const [k, bar] of bars[name].entries()) {
  if (words !== null) {
    // The shares are those of all cells of the file, of which a large one does not show every cell.
    const told = (text, share) => k === 0 ? `${text}, ${percent(share)}` : `${text}\n${percent(share)}`
    bar.major_label_overrides = new Map(words.map((text, i) => [i, told(text, about.shares[i][slice])]))
  } else {
    bar.title = about.label
  }
}

// Marks on cells that are not certified.
const places = Object.fromEntries(Object.keys(doubtful.data).map(key => [key, []]))
const bad = variables.certified?.words?.indexOf("not certified") ?? -1
const uncertain = i => bad >= 0 && cells.certified[first + i] === bad
const share = bad >= 0 ? variables.certified.shares[bad][slice] : 0
if (["regime", "motion"].includes(name) && share < 1) {
  if (edges === null) {
    for (let i = 0; i < size; i++) if (uncertain(i)) { places.x.push(view.data.x[i]); places.y.push(view.data.y[i]) }
  } else {
    const [x, y] = edges, across = x.length - 1
    for (let row = 0; row < y.length - 1; row++) {
      for (let i = 0; i < across; i++) {
        if (!uncertain(row * across + i)) continue
        const start = i
        while (i < across && uncertain(row * across + i)) i++
        places.left.push(x[start]); places.right.push(x[i]); places.bottom.push(y[row]); places.top.push(y[row + 1])
      }
    }
  }
}
doubtful.data = places
plot.title.text = about.title + (
  share === 0 ? "" : share === 1 ? "; no cell is certified" : `; marked: not certified, ${percent(share)}`
)

// Over one quantity, numbers are a line and classes are a strip.
if (line !== null) {
  drawn.visible = words !== null
  for (const renderer of curve) renderer.visible = words === null
  for (const axis of plot.left) { axis.visible = words === null; axis.axis_label = about.label }
  const numbers = Array.from({length: size}, (_, i) => shown(i)), finite = numbers.filter(Number.isFinite)
  const low = finite.length ? Math.min(...finite) : 0, high = finite.length ? Math.max(...finite) : 1
  const margin = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1
  const [start, end] = words !== null ? [0, 1] : [low - margin, high + margin]
  plot.y_range.setv({start, end, reset_start: start, reset_end: end})
  line.data = {x: line.data.x, value: numbers}
}

// Text about the cell at the pointer.
window.ringsweep_tell = place => {
  const i = cellAt(place.image_index?.flat_index ?? place.index)
  const lines = coordinates.map(coordinate => {
    let k = 0
    for (const [stride, length] of coordinate.along) k = k * length + Math.floor((first + i) / stride) % length
    return coordinate.texts[k]
  })
  const regime = word("regime", i), motion = word("motion", i)
  if (regime !== undefined) lines.push(motion === undefined || motion === regime ? regime : `${regime} (${motion})`)
  if (words !== null) {
    if (name !== "regime") lines.push(`${about.title}: ${words[values[first + i]] ?? "no value"}`)
  } else {
    const value = values[first + i], error = cells[about.error]?.[first + i]
    lines.push(`${about.label}: ${Number.isFinite(value) ? number(value) : "no value"}`)
    if (Number.isFinite(error)) lines.push(`error at most ${number(upwards(error))}`)
  }
  const origin = word("origin", i)
  lines.push(origin === "inferred" ? "inferred from its neighbours, not run" : word("certified", i) ?? "")
  return lines.filter(text => text !== "").join("\n")
}

// A dark browser gets a dark page.
if (window.matchMedia("(prefers-color-scheme: dark)").matches) {
  const [text, page] = ["#e0e0e0", "#181818"]
  const colours = {
    background_fill_color: page, border_fill_color: page, text_color: text,
    title_text_color: text, axis_label_text_color: text, major_label_text_color: text,
    axis_line_color: text, major_tick_line_color: text, minor_tick_line_color: text,
  }
  for (const model of [plot, plot.title, ...plot.left, ...plot.below, ...Object.values(bars)]) {
    for (const [key, colour] of Object.entries(colours)) if (key in model.properties) model[key] = colour
  }
  document.documentElement.style.colorScheme = "dark"
  document.body.style.background = page
  document.body.style.color = text
}
