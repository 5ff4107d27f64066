// Plays the events of this page. Times are microseconds since the first event or frame.
"use strict";

const $ = (id) => document.getElementById(id);
const facts = JSON.parse($("facts").textContent);

// ---- The events: unpacked from columns of bytes.

async function unpacked() {
  const text = atob($("events").textContent);
  const data = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const count = facts.drawn;
  const sizes = [7, 2, 2]; // bytes of the time since the event before, of x and of y
  const size = 11 * count + Math.ceil(count / 8);
  const plain = () => {
    const stream = new Blob([data]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  };
  const bytes = window.DecompressionStream ? new Uint8Array(await plain()) : inflated(data, size);
  const columns = [new Float64Array(count), new Uint16Array(count), new Uint16Array(count)];
  let place = 0;
  columns.forEach((column, which) => {
    for (let digit = 0; digit < sizes[which]; digit++) {
      const worth = 256 ** digit;
      for (let n = 0; n < count; n++) column[n] += bytes[place++] * worth;
    }
  });
  const [t, x, y] = columns;
  const p = new Uint8Array(count);
  for (let n = 0, now = facts.begin; n < count; n++) {
    now += t[n];
    t[n] = now;
    p[n] = (bytes[place + (n >> 3)] >> (7 - (n & 7))) & 1;
  }
  return { t, x, y, p, count };
}

// For browsers without DecompressionStream: deflate (RFC 1951), behind the two bytes of zlib.
function inflated(data, size) {
  const out = new Uint8Array(size);
  let [place, at] = [0, 16];
  const bits = (count) => {
    let value = 0;
    for (let n = 0; n < count; n++, at++) value |= ((data[at >> 3] >> (at & 7)) & 1) << n;
    return value;
  };
  const codeOf = (lengths) => {
    const counts = new Array(16).fill(0);
    for (const length of lengths) counts[length] += length > 0;
    const order = lengths.map((length, symbol) => [length, symbol]).filter(([length]) => length);
    return { counts, symbols: order.sort((a, b) => a[0] - b[0]).map(([, symbol]) => symbol) };
  };
  const next = ({ counts, symbols }) => {
    for (let [length, value, first, index] = [1, 0, 0, 0]; length < 16; length++) {
      value = 2 * value + bits(1);
      first *= 2;
      if (value < first + counts[length]) return symbols[index + value - first];
      index += counts[length];
      first += counts[length];
    }
    throw new Error("they are damaged");
  };
  // four lengths, and two distances, of a kind have as many bits more
  const grown = (symbol, base, kind) => {
    if (symbol < 2 * kind) return base + symbol;
    const more = Math.floor(symbol / kind) - 1;
    return base + ((kind + (symbol % kind)) << more) + bits(more);
  };
  const described = () => {
    const [literals, distances, many] = [bits(5) + 257, bits(5) + 1, bits(4) + 4];
    const lengths = new Array(19).fill(0);
    const order = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
    for (let n = 0; n < many; n++) lengths[order[n]] = bits(3);
    const code = codeOf(lengths);
    lengths.length = 0;
    while (lengths.length < literals + distances) {
      const symbol = next(code);
      const [first, extra] = { 16: [3, 2], 17: [3, 3], 18: [11, 7] }[symbol] ?? [1, 0];
      const length = symbol < 16 ? symbol : symbol === 16 ? lengths[lengths.length - 1] : 0;
      for (let n = first + bits(extra); n > 0; n--) lengths.push(length);
    }
    return [codeOf(lengths.slice(0, literals)), codeOf(lengths.slice(literals))];
  };
  const run = (count, value) => new Array(count).fill(value);
  const fixed = [...run(144, 8), ...run(112, 9), ...run(24, 7), ...run(8, 8)];
  for (let last = 0; !last;) {
    last = bits(1);
    const kind = bits(2);
    if (kind === 0) { // stored as it is, behind its length and the same turned over
      at = (at + 7) & ~7;
      const length = bits(16);
      at += 16;
      for (let n = 0; n < length; n++) out[place++] = bits(8);
      continue;
    }
    const [literal, distance] = kind === 1 ? [codeOf(fixed), codeOf(run(30, 5))] : described();
    for (let symbol = next(literal); symbol !== 256; symbol = next(literal)) {
      if (symbol < 256) out[place++] = symbol;
      else {
        const length = symbol === 285 ? 258 : grown(symbol - 257, 3, 4);
        const from = place - grown(next(distance), 1, 2);
        for (let n = 0; n < length; n++) out[place++] = out[from + n];
      }
    }
  }
  return out;
}

// ---- What can be chosen.

const COLOURS = [ // name, ground, ON, OFF; orange and blue are those of Okabe and Ito
  ["red, blue on white", "#ffffff", "#d61e24", "#1854cd"],
  ["red, blue on black", "#000000", "#ff5a50", "#5a8cff"],
  ["colour-blind safe", "#ffffff", "#d55e00", "#0072b2"],
  ["colour-blind safe, dark", "#000000", "#e69f00", "#56b4e9"],
  ["white, blue on night", "#1e2534", "#ffffff", "#407ec9"],
  ["green, red on black", "#000000", "#30d050", "#ff4040"],
  ["white, black on grey", "#808080", "#ffffff", "#000000"],
];
const SPEEDS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];
const DEPTHS = [5, 10, 20, 50, 100, 0]; // in windows; 0: all time
const SHOWN = ["both", "plane", "cloud"];
const TURNED = { yaw: 0.75, pitch: -0.42 }; // from above, the newest events in front

const whole = facts.stop - facts.begin;
const WINDOWS = [];
for (let power = 10; power < Math.max(1e4, whole); power *= 10) {
  WINDOWS.push(power, 2 * power, 5 * power);
}

const state = { at: facts.begin, playing: false, show: "both", frames: 1, ...TURNED };
let events = { count: 0 };

function usual() {
  // long enough for some thousand events that are drawn, short enough to play
  const many = Math.min(2000, (facts.width * facts.height) / 20);
  const some = (whole / Math.max(1, facts.drawn)) * many;
  const wanted = Math.min(Math.max(Math.min(2e4, 5 * some), some), 1e6, whole / 5);
  state.window = Math.max(0, WINDOWS.filter((one) => one <= wanted).length - 1);
  const slow = SPEEDS.filter((speed) => speed <= 1 && whole / speed >= 8e6);
  state.speed = Math.max(0, slow.length - 1);
  state.depth = 1;
  state.colours = matchMedia("(prefers-color-scheme: dark)").matches ? 1 : 0;
  state.show = matchMedia("(max-width: 760px)").matches ? "plane" : "both";
  state.at = Math.min(facts.stop, facts.begin + 10 * currentWindow());
}

// ---- Numbers as people read them.

const grouped = (value) => Math.round(value).toLocaleString("en-US");
const told = (us) => { // with digits enough for the window
  const digits = Math.min(6, Math.max(3, 7 - Math.floor(Math.log10(currentWindow()))));
  return `${(us / 1e6).toFixed(digits)} s`;
};

function length(us) {
  if (us >= 1e6) return `${us / 1e6} s`;
  return us >= 1000 ? `${us / 1000} ms` : `${us} µs`;
}

function short(value) {
  for (const [worth, name] of [[1e6, " M"], [1e3, " k"]]) {
    if (value >= worth) return `${+(value / worth).toPrecision(3)}${name}`;
  }
  return `${+value.toPrecision(3)}`;
}

// ---- The time that is shown.

const currentWindow = () => WINDOWS[state.window];
const currentDepth = () => DEPTHS[state.depth] * currentWindow() || whole;

// Return the number of events before a time.
function before(us) {
  let [low, high] = [0, events.count];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (events.t[middle] < us) low = middle + 1;
    else high = middle;
  }
  return low;
}

function go(us) {
  state.at = Math.min(facts.stop, Math.max(facts.begin, us));
  changed();
}

function step(windows) {
  pause();
  go(Math.round(state.at + windows * currentWindow()));
}

let played = 0;
function play() {
  if (state.at >= facts.stop) state.at = facts.begin;
  state.playing = true;
  played = performance.now();
  changed();
}

const pause = () => { state.playing = false; changed(); };

// ---- Drawing: once for all that changed.

let waiting = false;
function changed() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(draw);
}

function draw(now) {
  waiting = false;
  if (state.playing) {
    const us = Math.max(0, now - played) * 1e3 * SPEEDS[state.speed];
    played = Math.max(now, played);
    state.at = Math.min(facts.stop, state.at + us);
    if (state.at >= facts.stop) state.playing = false;
    else changed();
  }
  if (state.show !== "cloud") drawPlane();
  if (state.show !== "plane") drawCloud();
  drawRate();
  tell();
}

const rgb = (colour) => [1, 3, 5].map((n) => parseInt(colour.slice(n, n + 2), 16));
const pixelOf = (colour) => { // as in the memory of an image; all machines of browsers agree
  const [red, green, blue] = rgb(colour);
  return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
};

function opened(id) {
  const canvas = $(id);
  const [, ground, on, off] = COLOURS[state.colours];
  const ink = rgb(ground).reduce((sum, one) => sum + one) > 380 ? "#333333" : "#d8d8d8";
  const inks = [pixelOf(off), pixelOf(on)];
  const [columns, rows, context] = [canvas.width, canvas.height, canvas.getContext("2d")];
  return { canvas, context, columns, rows, ground, on, off, ink, inks, dot: devicePixelRatio };
}

// On the sensor, each pixel has the colour of its last event. Where a pixel of the screen shows
// several of the sensor, it is the last of all of them, so that none is lost.
let cell = 1;
const sheet = document.createElement("canvas");
const pictures = facts.frames.map(([at, source]) => {
  const image = new Image();
  image.onload = changed;
  image.src = source;
  return { at, image };
});

function drawPlane() {
  const { canvas, context, columns, rows, ground, inks } = opened("plane");
  [sheet.width, sheet.height] = [columns, rows];
  context.fillStyle = ground;
  context.fillRect(0, 0, columns, rows);
  if (state.frames) {
    const frame = pictures.filter((one) => one.at <= state.at).pop();
    if (frame && frame.image.complete) context.drawImage(frame.image, 0, 0, columns, rows);
  }
  const image = context.createImageData(columns, rows);
  const pixels = new Uint32Array(image.data.buffer);
  const { x, y, p } = events;
  const [first, stop] = [before(state.at - currentWindow()), before(state.at)];
  // a few events of many small pixels would hardly be seen
  const large = stop - first < 3000 && canvas.clientWidth < 1.5 * columns ? 2 : 1;
  for (let n = first; n < stop; n++) {
    const [row, column] = [Math.floor(y[n] / cell), Math.floor(x[n] / cell)];
    for (let line = row; line < Math.min(rows, row + large); line++) {
      const place = line * columns + column;
      pixels.fill(inks[p[n]], place, Math.min(place + large, (line + 1) * columns));
    }
  }
  sheet.getContext("2d").putImageData(image, 0, 0);
  context.drawImage(sheet, 0, 0);
}

// In x, y and time, points are put into the picture one by one, farther ones first.
const LONG = 1.5; // length of the axis of time, where the longer side of the sensor is 1

function projection(canvas) {
  const { width, height } = facts;
  const side = Math.max(width, height);
  const [sin, cos] = [Math.sin(state.yaw), Math.cos(state.yaw)];
  const [up, flat] = [Math.sin(state.pitch), Math.cos(state.pitch)];
  const radius = Math.hypot(width / side, height / side, LONG) / 2;
  const scale = (0.47 * Math.min(canvas.width, canvas.height * 1.25)) / radius;
  const place = (x, y, share) => {
    const [a, b, c] = [(x - width / 2) / side, (y - height / 2) / side, (share - 0.5) * LONG];
    return [
      canvas.width / 2 + scale * (a * cos + c * sin),
      canvas.height / 2 + scale * (a * sin * up + b * flat - c * cos * up),
    ];
  };
  return { place, newestInFront: cos * flat >= 0 };
}

function drawCloud() {
  const { canvas, context, columns, rows, ground, inks, dot } = opened("cloud");
  const depth = currentDepth();
  const from = DEPTHS[state.depth] ? state.at - depth : facts.begin;
  const { place, newestInFront } = projection(canvas);
  const image = context.createImageData(columns, rows);
  const pixels = new Uint32Array(image.data.buffer).fill(pixelOf(ground));
  const [begin, stop] = [before(from), before(from + depth)];
  const large = Math.round(dot) + (stop - begin < 20000 ? 1 : 0);
  const [left, top] = place(0.5, 0.5, 0).map((one) => one - large / 2);
  const [later, right, down] = [place(0.5, 0.5, 1), place(1.5, 0.5, 0), place(0.5, 1.5, 0)].map(
    (one) => [one[0] - large / 2 - left, one[1] - large / 2 - top],
  );
  const { t, x, y, p } = events;
  for (let n = 0; n < stop - begin; n++) {
    const one = newestInFront ? begin + n : stop - 1 - n;
    const share = (t[one] - from) / depth;
    const column = Math.floor(left + x[one] * right[0] + y[one] * down[0] + share * later[0]);
    const row = Math.floor(top + x[one] * right[1] + y[one] * down[1] + share * later[1]);
    if (column < 0 || row < 0 || column + large > columns || row + large > rows) continue;
    const place = row * columns + column;
    for (let line = 0; line < large; line++) {
      pixels.fill(inks[p[one]], place + line * columns, place + line * columns + large);
    }
  }
  context.putImageData(image, 0, 0);
  drawBox(place, from, depth);
}

function drawBox(place, from, depth) {
  const { width, height } = facts;
  const { context, columns, ink, dot } = opened("cloud");
  const corners = (share) => [[0, 0], [width, 0], [width, height], [0, height]]
    .map(([x, y]) => place(x, y, share));
  const around = (points) => {
    context.beginPath();
    for (const point of points) context.lineTo(...point);
    context.closePath();
    context.stroke();
  };
  context.strokeStyle = context.fillStyle = ink;
  [context.lineWidth, context.globalAlpha] = [dot, 0.35];
  const [first, last] = [corners(0), corners(1)];
  [first, last].forEach(around);
  first.forEach((corner, n) => around([corner, last[n]]));
  const share = (us) => Math.max(0, Math.min(1, (us - from) / depth));
  [context.lineWidth, context.globalAlpha] = [1.5 * dot, 0.9];
  around(corners(share(state.at)));
  context.lineWidth = dot;
  around(corners(share(state.at - currentWindow())));
  context.font = `${12 * dot}px system-ui, sans-serif`;
  context.textAlign = "center";
  const write = (text, [x, y], [awayX, awayY]) => {
    const far = Math.hypot(x - awayX, y - awayY) || 1;
    const out = 15 * dot;
    const half = context.measureText(text).width / 2 + 2 * dot;
    const across = Math.max(half, Math.min(columns - half, x + ((x - awayX) / far) * out));
    context.fillText(text, across, y + ((y - awayY) / far) * out + 4 * dot);
  };
  const middle = place(width / 2, height / 2, 0.5);
  write("x", place(width / 2, height, 1), middle);
  write("y", place(width, height / 2, 1), middle);
  write(told(from), place(0, height, 0), middle);
  write(told(from + depth), place(0, height, 1), middle);
}

// The rates over time [1/s]: ON upwards, OFF downwards.
const rates = (counts) => counts.map((count, n) => {
  const least = Math.min(facts.bin, 100); // a time that is no longer has one bin
  return (count / Math.max(least, Math.min(facts.bin, whole - n * facts.bin))) * 1e6;
});
const RATES = { on: rates(facts.on), off: rates(facts.off) };

function drawRate() {
  const { context, columns, rows, ground, on, off, ink, dot } = opened("rate");
  const across = (us) => ((us - facts.begin) / whole) * columns;
  const [head, foot] = [17 * dot, 18 * dot];
  const [top, low] = [Math.max(...RATES.on), Math.max(...RATES.off)];
  const each = (rows - foot - head - 2 * dot) / Math.max(1e-9, top + low);
  const zero = head + each * top;
  context.fillStyle = ground;
  context.fillRect(0, 0, columns, rows);
  for (const [name, colour, sign] of [["on", on, -1], ["off", off, 1]]) {
    context.fillStyle = colour;
    RATES[name].forEach((rate, n) => {
      const left = Math.floor(across(facts.begin + n * facts.bin));
      const right = Math.ceil(across(facts.begin + (n + 1) * facts.bin));
      context.fillRect(left, zero, right - left, sign * rate * each);
    });
  }
  context.fillStyle = ink;
  context.font = `${11 * dot}px system-ui, sans-serif`;
  context.globalAlpha = 0.6;
  context.fillRect(0, zero, columns, dot / 2);
  context.globalAlpha = 1;
  ticks(columns / dot / 110).forEach((us) => {
    const text = `${us / 1e6} s`;
    const half = context.measureText(text).width / 2;
    context.fillRect(across(us), rows - foot, dot, 4 * dot);
    context.textAlign = "center";
    const x = Math.min(columns - half - 3 * dot, Math.max(half + 3 * dot, across(us)));
    context.fillText(text, x, rows - 4 * dot);
  });
  context.textAlign = "left";
  context.fillText(`ON up to ${short(top)}/s, OFF ${short(low)}/s`, 6 * dot, 12 * dot);
  const left = across(state.at - currentWindow());
  context.globalAlpha = 0.25;
  context.fillRect(left, 0, across(state.at) - left, rows);
  context.globalAlpha = 1;
  context.fillRect(Math.min(columns - 2 * dot, across(state.at) - dot), 0, 2 * dot, rows);
}

// Return round times, about so many.
function ticks(many) {
  const least = Math.max(1, whole / Math.max(1, many));
  const power = 10 ** Math.floor(Math.log10(least));
  const apart = power * [1, 2, 5, 10].find((digit) => power * digit >= least);
  const found = [];
  for (let n = Math.ceil(facts.begin / apart); n * apart <= facts.stop; n++) found.push(n * apart);
  return found;
}

// ---- What is told beside the pictures.

let pointed = null; // where the pointer is on the sensor
function tell() {
  const [first, stop] = [before(state.at - currentWindow()), before(state.at)];
  const { x, y, p } = events;
  const [total, here] = [[0, 0], [0, 0]];
  for (let n = first; n < stop; n++) {
    total[p[n]]++;
    const [column, row] = [Math.floor(x[n] / cell), Math.floor(y[n] / cell)];
    if (pointed && column === pointed[0] && row === pointed[1]) here[p[n]]++;
  }
  const drawn = facts.every > 1 ? ` drawn, 1 of ${grouped(facts.every)}` : "";
  const window = length(currentWindow());
  let text = `${window}: ${grouped(total[1])} ON, ${grouped(total[0])} OFF${drawn}`;
  if (pointed) {
    const [left, top] = pointed.map((one) => one * cell);
    text += ` · x ${left}, y ${top}: ${here[1]} ON, ${here[0]} OFF`;
  }
  if (!facts.drawn) text = "There are no events here.";
  $("counts").textContent = text;
  $("time").textContent = told(state.at);
  $("play").textContent = state.playing ? "Pause" : "Play";
  $("play").setAttribute("aria-pressed", state.playing);
  $("rate").setAttribute("aria-valuenow", state.at / 1e6);
  $("rate").setAttribute("aria-valuetext", `${told(state.at)}, ${text}`);
  $("window").value = state.window;
  $("window").setAttribute("aria-valuetext", window);
  $("window-told").textContent = window;
  for (const name of ["speed", "colours", "depth", "show"]) $(name).value = state[name];
  $("frames").checked = state.frames;
}

function showTip(us, x) {
  const tip = $("tip");
  const bin = Math.min(facts.on.length - 1, Math.floor((us - facts.begin) / facts.bin));
  const [on, off] = [RATES.on[bin], RATES.off[bin]];
  tip.textContent = `${told(us)} · ON ${short(on)}/s, OFF ${short(off)}/s`;
  tip.hidden = false;
  const left = Math.min($("strip").clientWidth - tip.offsetWidth, x - tip.offsetWidth / 2);
  tip.style.left = `${Math.max(0, left)}px`;
}

// ---- The size of the pictures: as large as the page has room.

function layout() {
  const stage = $("stage");
  stage.className = state.show;
  const both = state.show === "both" && getComputedStyle(stage).gridTemplateColumns.includes(" ");
  const room = Math.max(80, (stage.clientWidth - (both ? 12 : 0)) / (both ? 2 : 1));
  const { width, height } = facts;
  // what is below the pictures is to be seen with them
  const most = Math.max(200, innerHeight - 280) * (state.show === "both" && !both ? 0.62 : 1);
  const scale = Math.min(room / width, most / height);
  const [plane, cloud, rate, dot] = [$("plane"), $("cloud"), $("rate"), devicePixelRatio];
  cell = Math.max(1, Math.ceil(1 / (scale * dot) - 0.01));
  [plane.width, plane.height] = [Math.ceil(width / cell), Math.ceil(height / cell)];
  plane.style.width = `${plane.width * cell * scale}px`;
  plane.style.height = `${plane.height * cell * scale}px`;
  const tall = both ? Math.max(height * scale, room / 2) : Math.min(most, room * 0.8);
  [cloud.width, cloud.height] = [Math.round(room * dot), Math.round(tall * dot)];
  cloud.style.width = `${room}px`;
  cloud.style.height = `${tall}px`;
  [rate.width, rate.height] = [rate.clientWidth * dot, rate.clientHeight * dot].map(Math.round);
  changed();
}

// ---- What people do: controls, pointers, keys.

function choose(name, number, values) {
  state[name] = Math.max(0, Math.min(values.length - 1, number));
  changed();
}

const show = (name) => { state.show = name; layout(); };

function fill(id, texts, values) {
  texts.forEach((text, n) => $(id).add(new Option(text, n)));
  $(id).onchange = () => choose(id, +$(id).value, values);
}

function turn(yaw, pitch) {
  state.yaw += yaw;
  state.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, state.pitch + pitch));
  changed();
}

function controls() {
  fill("speed", SPEEDS.map((one) => (one < 1 ? `1/${Math.round(1 / one)}` : `${one}`)), SPEEDS);
  fill("colours", COLOURS.map(([name]) => name), COLOURS);
  fill("depth", DEPTHS.map((count) => (count ? `${count} windows` : "all time")), DEPTHS);
  $("window").max = WINDOWS.length - 1;
  $("window").oninput = () => choose("window", +$("window").value, WINDOWS);
  $("show").onchange = () => show($("show").value);
  $("frames-label").hidden = !pictures.length;
  $("frames").onchange = () => choose("frames", +$("frames").checked, [0, 1]);
  $("play").onclick = () => (state.playing ? pause() : play());
  $("first").onclick = () => go(facts.begin);
  $("back").onclick = () => step(-1);
  $("next").onclick = () => step(1);
  for (const [name, text] of KEYS) {
    const row = $("keys").lastElementChild.insertRow();
    const key = document.createElement("kbd");
    key.textContent = NAMES[name] ?? name;
    row.insertCell().append(key);
    row.insertCell().append(text);
  }
  $("rate").setAttribute("aria-valuemin", facts.begin / 1e6);
  $("rate").setAttribute("aria-valuemax", facts.stop / 1e6);
}

function pointers() {
  const rate = $("rate");
  const scrub = (event) => {
    const box = rate.getBoundingClientRect();
    const share = Math.max(0, Math.min(1, (event.clientX - box.left) / box.width));
    if (event.buttons) {
      pause();
      go(facts.begin + share * whole);
    }
    showTip(facts.begin + share * whole, share * box.width);
  };
  rate.onpointerdown = (event) => { rate.setPointerCapture(event.pointerId); scrub(event); };
  rate.onpointermove = scrub;
  rate.onpointerleave = rate.onpointercancel = () => { $("tip").hidden = true; };
  rate.onpointerup = (event) => { if (event.pointerType !== "mouse") $("tip").hidden = true; };

  const plane = $("plane");
  plane.onpointermove = plane.onpointerdown = (event) => {
    const box = plane.getBoundingClientRect();
    const inside = (share, most) => Math.max(0, Math.min(most - 1, Math.floor(share * most)));
    pointed = [
      inside((event.clientX - box.left) / box.width, plane.width),
      inside((event.clientY - box.top) / box.height, plane.height),
    ];
    changed();
  };
  plane.onpointerleave = () => { pointed = null; changed(); };

  const cloud = $("cloud");
  let from = [0, 0];
  cloud.onpointerdown = (event) => {
    cloud.setPointerCapture(event.pointerId);
    from = [event.clientX, event.clientY];
  };
  cloud.onpointermove = (event) => {
    if (!event.buttons || !event.isPrimary) return;
    turn((event.clientX - from[0]) / 150, (from[1] - event.clientY) / 150);
    from = [event.clientX, event.clientY];
  };
}

const KEYS = [ // what is pressed, what the list on the page says of it, and what it does
  ["Space", "play, pause", () => (state.playing ? pause() : play())],
  ["ArrowLeft", "one window back; with Shift ten", (event) => step(event.shiftKey ? -10 : -1)],
  ["ArrowRight", "one window on; with Shift ten", (event) => step(event.shiftKey ? 10 : 1)],
  [",", "a tenth of a window back", () => step(-0.1)],
  [".", "a tenth of a window on", () => step(0.1)],
  ["Home", "to the beginning", () => go(facts.begin)],
  ["End", "to the end", () => go(facts.stop)],
  ["-", "slower", () => choose("speed", state.speed - 1, SPEEDS)],
  ["+", "faster", () => choose("speed", state.speed + 1, SPEEDS)],
  ["[", "shorter window", () => choose("window", state.window - 1, WINDOWS)],
  ["]", "longer window", () => choose("window", state.window + 1, WINDOWS)],
  ["c", "other colours", () => choose("colours", (state.colours + 1) % COLOURS.length, COLOURS)],
  ["f", "frames beneath the events", () => choose("frames", 1 - state.frames, [0, 1])],
  ["v", "sensor, x-y-time, or both", () => show(SHOWN[(SHOWN.indexOf(state.show) + 1) % 3])],
  ["t", "depth: how much time the x-y-time view holds",
    () => choose("depth", (state.depth + 1) % DEPTHS.length, DEPTHS)],
  ["a", "turn it to the left", () => turn(-0.1, 0)],
  ["d", "turn it to the right", () => turn(0.1, 0)],
  ["w", "look from higher up", () => turn(0, -0.1)],
  ["s", "look from lower down", () => turn(0, 0.1)],
  ["r", "turn it back", () => { Object.assign(state, TURNED); changed(); }],
  ["?", "this list", () => { $("keys").open = !$("keys").open; }],
];
const NAMES = { ArrowLeft: "←", ArrowRight: "→" };

function pressed(event) {
  const name = { " ": "Space", "=": "+" }[event.key] ?? event.key;
  const key = KEYS.find(([one]) => one === name || one === name.toLowerCase());
  if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
  const kind = event.target.type ?? event.target.localName; // which has keys of its own
  if (kind === "select-one" || kind === "summary") return;
  if (kind === "range" && /^(Arrow|Home|End)/.test(name)) return;
  if ((kind === "submit" || kind === "checkbox") && name === "Space") return;
  event.preventDefault();
  key[2](event);
}

async function begin() {
  usual();
  controls();
  pointers();
  addEventListener("keydown", pressed);
  addEventListener("resize", layout);
  layout();
  events = await unpacked();
  document.documentElement.dataset.ready = "";
  changed();
}

begin().catch((error) => {
  $("failed").textContent = `The events cannot be shown: ${error.message}`;
  $("failed").hidden = false;
});
