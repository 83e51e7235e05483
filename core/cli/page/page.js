/* The script of interactive pages: runs the model in the browser and shows the result.  It follows the script of
 * animate.html, which draws `run` at the time state.t: begin() shows the first run, load() another one, key() the legend
 * of its curves, seek() a time; $, number, raised, size, place, placement, save, count, bodies, colours, palette and circle
 * are from there, too. */

/* ---- The engine: the model and the integrators, compiled to WebAssembly ---- */

const bytesOf = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));

/* What the engine imports: the clock, system calls that fail, and functions of libraries that it does not have, which stop
 * the run. */
function importsOf (module) {
  const notSupported = 52; /* the error ENOSYS of WASI */
  const imports = {};
  for (const { module: from, name } of WebAssembly.Module.imports(module)) {
    imports[from] = imports[from] || {};
    imports[from][name] = from === "wasi_snapshot_preview1" ? () => notSupported
      : () => { throw new Error("this scene needs " + name + ", which pages do not have"); };
  }
  imports.page = { now: () => performance.now() };
  return imports;
}

const shortRun = 40, usualRun = 4000, longRun = 8000; /* limits of the computing time of a run [ms] */

class Engine {
  static async open (page) {
    const module = await WebAssembly.compile(bytesOf(page.files.engine)), engine = new Engine();
    engine.module = module;
    engine.page = page;
    await engine.restart();
    return engine;
  }

  /* A new instance: at first, and after a run that the engine could not end. */
  async restart () {
    this.wasm = (await WebAssembly.instantiate(this.module, importsOf(this.module))).exports;
    this.wasm._initialize();
    for (const [name, text] of Object.entries(this.page.files))
      if (name !== "engine") {
        const bytes = bytesOf(text);
        this.wasm.file(this.text(name), this.copy(bytes), bytes.length);
      }
    if (this.wasm.open(this.text(this.page.name)) !== 0) throw new Error(this.error());
  }

  /* Copies bytes into the memory of the engine, and a 0 after them; returns the address. */
  copy (bytes) {
    const at = this.wasm.allocate(bytes.length + 1);
    new Uint8Array(this.wasm.memory.buffer, at, bytes.length).set(bytes);
    return at;
  }
  text (text) { return this.copy(new TextEncoder().encode(text)); }
  /* The text at an address. */
  read (at) {
    const bytes = new Uint8Array(this.wasm.memory.buffer);
    return new TextDecoder().decode(bytes.subarray(at, bytes.indexOf(0, at)));
  }
  error () { return this.read(this.wasm.error()); }
  numbers (at, count) { return new Float64Array(this.wasm.memory.buffer, at, count); }

  /* Integrates with { method, step, rtol, end, parameters, initial: [[state, value]] } for at most `limit` ms; returns the
   * computing time [ms] and the reason of a failure, or "". */
  integrate (s, limit, keepSamples) {
    const wasm = this.wasm, method = this.text(s.method);
    const parameters = wasm.allocate(8 * s.parameters.length), initial = wasm.allocate(16 * s.initial.length);
    const view = new DataView(wasm.memory.buffer, initial); /* after the allocations, which may replace the buffer */
    this.numbers(parameters, s.parameters.length).set(s.parameters);
    /* a pw_initial_value has 16 bytes: the state at 0, the value at 8 */
    s.initial.forEach(([state, value], i) => { view.setInt32(16 * i, state, true); view.setFloat64(16 * i + 8, value, true); });
    const before = performance.now();
    const status = wasm.run(method, s.step, s.rtol, s.end, limit, keepSamples, parameters, initial, s.initial.length);
    const ms = performance.now() - before;
    for (const at of [method, parameters, initial]) wasm.release(at);
    return { ms, reason: status === 0 ? "" : this.error() };
  }

  /* The least of three computing times, without samples [ms]. */
  time (s) {
    return Math.min(...[1, 2, 3].map(() => this.integrate(s, longRun, 0).ms));
  }

  /* A run for load(), with its computing time [ms] and statistics. */
  run (s, limit) {
    const tooLarge = this.page.parameters.find((p, i) => p.domain === "count" && s.parameters[i] > 200);
    if (tooLarge) throw new Error(tooLarge.name + " is too large for a page, which takes at most 200; use the program");
    const { ms, reason } = this.integrate(s, limit, 1), scene = this.scene();
    if (!scene || scene.samples < 2) throw new Error(reason || "the run has no samples");
    return { ...scene, ...this.arrays(scene), model: this.page.name, about: this.page.about, method: s.method, reason, ms };
  }

  /* Shapes, number and width of samples, and statistics of the last run; null without one. */
  scene () {
    const at = this.wasm.scene(), scene = at ? JSON.parse(this.read(at)) : null;
    this.wasm.release(at);
    return scene;
  }

  /* The columns of the samples: t, 6 energies; x, y, phi and velocities of bodies; contacts of wheels; forces of links. */
  arrays (scene) {
    const { samples, width } = scene, data = this.numbers(this.wasm.data(), samples * width);
    let from = 7; /* after t and energies */
    const columns = (first, count) => {
      const part = new Float64Array(samples * count);
      for (let i = 0; i < samples; i++) part.set(data.subarray(i * width + first, i * width + first + count), i * count);
      return part;
    };
    const next = count => { from += count; return columns(from - count, count); };
    return { t: columns(0, 1), energy: columns(1, 6), motion: next(6 * scene.bodies.length),
      contact: next(3 * scene.wheels.length), force: next(2 * scene.links.length) };
  }
}

/* ---- The panel ---- */

/* page: the data of the model; settings: those of the panel; runs: { method, ms, error } in the plot. */
let engine, page, settings, runs = [];

const byName = name => page.methods.find(m => m.name === name);
/* A new copy of the settings with which the page begins. */
const pageSettings = () => ({ method: page.method, accuracy: null, end: page.t_end,
  parameters: page.parameters.map(p => p.value), initial: new Map(page.states.flatMap((x, i) => x.given ? [[i, x.value]] : [])) });

/* The tolerance of an adaptive method, else the step size [s]; the slider is its decimal logarithm. */
function accuracy (s) {
  return s.accuracy ?? (byName(s.method).adaptive ? page.rtol : page.step);
}
/* A copy of the settings for the engine.  Initial values are used only if the numbers of bodies are those with which the
 * page begins: indices of states depend on them. */
function engineSettings (s) {
  const otherCounts = page.parameters.some((p, i) => p.domain === "count" && s.parameters[i] !== p.value);
  return { ...s, parameters: [...s.parameters], initial: otherCounts ? [] : [...s.initial], step: accuracy(s), rtol: accuracy(s) };
}

/* Adds a label with a slider and a field for a number; `change` is called with a new number. */
function control (parent, name, unit, about, value, low, high, step, change) {
  const label = document.createElement("label"), text = document.createElement("span");
  const slider = document.createElement("input"), number = document.createElement("input");
  text.textContent = name + (unit ? " [" + unit.replace(/\^(\d)/g, (all, n) => raised(n)) + "]" : "");
  slider.type = "range";
  number.type = "number";
  slider.setAttribute("aria-label", text.textContent + (about ? ": " + about : ""));
  number.setAttribute("aria-label", text.textContent);
  slider.min = low; slider.max = high; slider.step = step || (high - low) / 1000;
  number.step = step || "any";
  const short = x => Number(x.toPrecision(7));
  slider.dataset.name = number.dataset.name = name;
  const show = x => { slider.value = x; number.value = short(x); };
  const set = x => { value = x; change(x); };
  slider.addEventListener("input", () => { number.value = Number(Number(slider.value).toPrecision(4)); set(Number(number.value)); });
  number.addEventListener("change", () => {
    const x = Number(number.value);
    if (number.value === "" || !isFinite(x)) return show(value);
    slider.min = Math.min(slider.min, x); slider.max = Math.max(slider.max, x);
    slider.value = x;
    set(x);
  });
  show(value);
  label.append(text, slider, number);
  if (about) label.append(Object.assign(document.createElement("small"), { textContent: about }));
  parent.append(label);
  return { slider, number };
}

/* Sliders whose ends are still to be checked, each with its first value and a function that sets a value in settings. */
let unchecked = [];

/* Moves the ends of the next slider towards its first value, by half of the distance up to six times, then to that value,
 * until a run can begin there and does not fail within shortRun; then continues with the next slider. */
async function narrowSliders () {
  const next = unchecked.shift();
  if (!next) { document.documentElement.dataset.narrowed = true; return; }
  const { slider, number, value, set } = next, valid = slider.step === "1" ? Math.round : x => x;
  for (const end of ["min", "max"]) {
    let x = Number(slider[end]);
    for (let k = 0; x !== value && !await runsWith(set, x); k++) x = k < 6 ? valid(value + (x - value) / 2) : value;
    slider[end] = Math[end](x, Number(number.value));
  }
  slider.disabled = slider.min === slider.max;
  if (slider.disabled) slider.title = "the model does not run with other values near this one";
  setTimeout(narrowSliders, 0);
}

/* Whether the engine can run with the value x of a slider, at least until the limit of computing time stops it. */
async function runsWith (set, x) {
  const s = pageSettings();
  set(s, x);
  try {
    return /^(stopped at.*)?$/.test(engine.integrate(engineSettings(s), shortRun, 0).reason);
  } catch (error) {
    await engine.restart();
    return false;
  }
}

/* [low, high, step] of the slider of a value in a domain; step 0: any number. */
function rangeOf (value, domain) {
  if (domain === "count") return [1, Math.max(10, 2 * value), 1];
  if (domain === "fraction") return [0, 1, 0];
  if (domain === "positive") return [value / 10, 3 * value, 0];
  if (domain === "nonnegative") return [0, value > 0 ? 3 * value : 1, 0];
  const size = Math.abs(value) || 1;
  return [value - 2 * size, value + 2 * size, 0];
}

function fillPanel () {
  $("page-method").replaceChildren(...page.methods.map(m => new Option(m.name)));
  $("page-method").value = settings.method;
  $("page-end").value = settings.end;
  for (const id of ["parameters", "states"]) while ($(id).querySelector("label")) $(id).querySelector("label").remove();
  const add = (parent, quantity, about, value, first, domain, set) => unchecked.push({ set, value: first,
    ...control(parent, quantity.name, quantity.unit, about, value, ...rangeOf(first, domain), x => { set(settings, x); simulateSoon(); }) });
  unchecked = [];
  page.parameters.forEach((p, i) => add($("parameters"), p, p.about, settings.parameters[i], p.value, p.domain,
    (s, x) => { s.parameters[i] = x; }));
  page.states.forEach((state, i) => add($("states"), state, "", settings.initial.get(i) ?? state.value, state.value, "real",
    (s, x) => s.initial.set(i, x)));
  $("parameters").hidden = page.parameters.length === 0;
  fillAccuracy();
}

function fillAccuracy () {
  const adaptive = byName(settings.method).adaptive;
  $("page-accuracy-name").textContent = adaptive ? "Tolerance" : "Step size [s]";
  const power = x => Math.floor(Math.log10(x));
  $("page-accuracy").min = adaptive ? -12 : Math.min(-5, power(page.step) - 1);
  $("page-accuracy").max = adaptive ? -2 : Math.min(-1, power(page.t_end) - 1);
  $("page-accuracy").step = adaptive ? 0.5 : 0.25;
  $("page-accuracy").value = Math.log10(accuracy(settings));
  $("page-accuracy-value").textContent = rounded(accuracy(settings));
}

/* ---- Runs ---- */

/* Simulates when the settings have not changed for 20 ms. */
let timer = 0;
function simulateSoon () {
  clearTimeout(timer);
  timer = setTimeout(simulate, 20);
}

/* The largest difference of x, y [m] and phi [rad] of the bodies at the end. */
function difference (a, b) {
  let most = 0;
  for (let k = 0; k < 6 * a.bodies.length; k++)
    if (k % 6 < 3) most = Math.max(most, Math.abs(a.motion[a.motion.length - 6 * a.bodies.length + k] - b.motion[b.motion.length - 6 * b.bodies.length + k]));
  return most;
}

/* Runs with the settings of the panel and shows the result; 300 ms later, if the run was complete and no other one has
 * followed, estimates its error. */
let estimateTimer = 0;
function simulate () {
  const used = engineSettings(settings);
  let result;
  clearTimeout(estimateTimer);
  document.documentElement.dataset.simulated = "";
  try {
    result = engine.run(used, usualRun);
  } catch (error) {
    engine.restart();
    $("reason").textContent = error.message + (run ? ". The run before it is still shown." : "");
    document.documentElement.dataset.simulated = "error";
    return;
  }
  const t = state.t;
  if (run) { load(result); key(); seek(t); } else begin(result);
  showCost(result, null);
  showValues();
  try {
    history.replaceState(null, "", "#" + link());
  } catch (error) {
    $("page-link").hidden = true; /* in a frame of another document the page has no address of its own */
  }
  document.documentElement.dataset.simulated = "yes";
  if (!result.reason) estimateTimer = setTimeout(() => estimate(result, used), 300);
}

/* Estimates the error of the result of these settings by a reference: erk8+projection with a tolerance of 1e-13. */
function estimate (result, used) {
  try {
    const reference = engine.run({ ...used, method: "erk8+projection", rtol: 1e-13 }, longRun);
    if (reference.reason) return;
    const error = difference(result, reference);
    result.ms = Math.max(engine.time(used), 0.01); /* logarithmic axes have no 0 */
    runs.push({ method: result.method, ms: result.ms, error: Math.max(error, 1e-16) });
    showCost(result, error);
    document.documentElement.dataset.estimated = error;
  } catch (error) {
    engine.restart();
  }
}

function fillTable (id, list) {
  $(id).replaceChildren(...list.map(([name, value]) => {
    const row = document.createElement("tr");
    for (const text of [name, value]) row.append(Object.assign(document.createElement("td"), { textContent: text }));
    return row;
  }));
}
/* A number with two digits. */
function rounded (x) { return Number.isFinite(x) ? number(x, Math.abs(x) / 10) : "unknown"; }

function showCost (result, error) {
  fillTable("page-results", [["error at the end [m, rad]", error === null ? "\u2026" : rounded(error)],
    ["computing time", (result.ms < 10 ? result.ms.toFixed(2) : result.ms.toFixed(0)) + " ms"], ["steps (rejected)", result.steps + " (" + result.rejected + ")"],
    ["evaluations of accelerations", String(result.evaluations)], ["largest position residual |g|", rounded(result.g)],
    ["largest velocity residual |J v \u2212 \u03b7|", rounded(result.jv)],
    ["relative energy defect", rounded(result.energy_defect)]]);
  plotRuns();
}

/* Values of all bodies at the time shown, interpolated between samples. */
function showValues () {
  if (!$("values").open) return;
  const at = place(state.t);
  fillTable("page-values", run.bodies.flatMap((body, b) => placement(b, at).map((x, k) => [body.name + [".x", ".y", ".phi"][k], x.toPrecision(10)])));
}

/* Error over computing time, both logarithmic; the last run is filled. */
function plotRuns () {
  const area = size($("page-plot")), g = area.g, points = runs.slice(-60);
  g.clearRect(0, 0, area.width, area.height);
  if (points.length === 0) return;
  const logs = pick => points.map(p => Math.log10(p[pick])), box = list => [Math.floor(Math.min(...list) - 0.2), Math.ceil(Math.max(...list) + 0.2)];
  const [x0, x1] = box(logs("ms")), [y0, y1] = box(logs("error"));
  const X = x => 38 + (area.width - 48) * (x - x0) / (x1 - x0), Y = y => area.height - 26 - (area.height - 36) * (y - y0) / (y1 - y0);
  g.font = "11px system-ui, sans-serif";
  g.strokeStyle = colours.grid;
  g.fillStyle = colours.faint;
  g.beginPath();
  g.textAlign = "center";
  const power = n => "10" + raised(n);
  for (let x = x0; x <= x1; x++) { g.moveTo(X(x), Y(y0)); g.lineTo(X(x), Y(y1)); g.fillText(power(x), X(x), area.height - 14); }
  const stride = Math.ceil((y1 - y0) / 7);
  g.textAlign = "right";
  for (let y = y0; y <= y1; y += stride) { g.moveTo(X(x0), Y(y)); g.lineTo(X(x1), Y(y)); g.fillText(power(y), 34, Y(y) + 4); }
  g.stroke();
  g.textAlign = "center";
  g.fillText("error over computing time [ms]", area.width / 2, area.height - 2);
  const colour = method => palette[page.methods.findIndex(m => m.name === method) % palette.length];
  g.textAlign = "right";
  [...new Set(points.map(p => p.method))].forEach((method, i) => { g.fillStyle = colour(method); g.fillText(method, area.width - 12, 16 + 13 * i); });
  points.forEach((p, i) => {
    g.strokeStyle = g.fillStyle = colour(p.method);
    g.beginPath();
    g.arc(X(Math.log10(p.ms)), Y(Math.log10(p.error)), i === points.length - 1 ? 5 : 3.5, 0, circle);
    i === points.length - 1 ? g.fill() : g.stroke();
  });
}

/* ---- Links, files, controls ---- */

/* What differs from the page's own settings, as in "method=rk4+projection&a=0.7&start.frame.x=1". */
function link () {
  const list = new URLSearchParams();
  if (settings.method !== page.method) list.set("method", settings.method);
  if (settings.accuracy !== null) list.set("accuracy", settings.accuracy);
  if (settings.end !== page.t_end) list.set("t_end", settings.end);
  page.parameters.forEach((p, i) => { if (settings.parameters[i] !== p.value) list.set(p.name, settings.parameters[i]); });
  for (const [i, value] of settings.initial)
    if (!page.states[i].given || value !== page.states[i].value) list.set("start." + page.states[i].name, value);
  return list.toString();
}

/* Sets the settings from the address of the page, as link() writes them. */
function readLink () {
  const list = new URLSearchParams(location.hash.slice(1)), number = (key, otherwise, low = -Infinity) => {
    const text = (list.get(key) || "").trim(), x = Number(text);
    return text && isFinite(x) && x > low ? x : otherwise;
  };
  settings = pageSettings();
  if (byName(list.get("method"))) settings.method = list.get("method");
  settings.accuracy = number("accuracy", null, 0);
  settings.end = number("t_end", page.t_end, 0);
  page.parameters.forEach((p, i) => { settings.parameters[i] = number(p.name, p.value); });
  page.states.forEach((state, i) => { const x = number("start." + state.name, null); if (x !== null) settings.initial.set(i, x); });
}

function csv () {
  const names = run.bodies.flatMap(body => ["x [m]", "y [m]", "phi [rad]", "vx [m/s]", "vy [m/s]", "omega [rad/s]"].map(n => body.name + "." + n));
  const lines = [["t [s]", ...names].join(",")];
  for (let i = 0; i < count; i++) lines.push([run.t[i], ...run.motion.subarray(6 * i * bodies, 6 * (i + 1) * bodies)].join(","));
  return lines.join("\n") + "\n";
}

function addListeners () {
  $("page-method").addEventListener("change", e => { settings.method = e.target.value; settings.accuracy = null; fillAccuracy(); simulateSoon(); });
  $("page-accuracy").addEventListener("input", e => {
    settings.accuracy = Number(Math.pow(10, Number(e.target.value)).toPrecision(3));
    $("page-accuracy-value").textContent = rounded(settings.accuracy);
    simulateSoon();
  });
  $("page-end").addEventListener("change", e => { if (Number(e.target.value) > 0) { settings.end = Number(e.target.value); simulateSoon(); } });
  $("page-reset").addEventListener("click", () => { settings = pageSettings(); runs = []; fillPanel(); simulate(); narrowSliders(); });
  $("page-csv").addEventListener("click", () => save(page.name + ".csv", new Blob([csv()], { type: "text/csv" })));
  $("page-link").addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(location.href);
      $("page-copied").textContent = "copied";
    } catch (error) {
      $("page-copied").textContent = "copy the address of this page";
    }
  });
  $("values").addEventListener("toggle", showValues);
  $("scrub").addEventListener("input", showValues);
  window.addEventListener("resize", plotRuns);
  window.addEventListener("hashchange", () => { if (location.hash.slice(1) !== link()) { readLink(); fillPanel(); simulate(); narrowSliders(); } });
}

/* Starts the page with the data that page.c writes. */
async function start_page (data) {
  page = data;
  $("model").textContent = page.name;
  $("about").textContent = page.about;
  readLink();
  fillPanel();
  addListeners();
  if (typeof WebAssembly !== "object") {
    $("reason").textContent = "This page simulates with WebAssembly, which this browser does not have or has switched off.";
    return;
  }
  try {
    engine = await Engine.open(page);
    simulate();
    narrowSliders();
  } catch (error) {
    $("reason").textContent = error.message;
  }
}
