/* The script of interactive pages: runs the model in the browser and shows the result.  It follows the script of
 * animate.html, which draws `run` at the time state.t: begin() shows the first run, load() another one, key() the legend
 * of its curves, seek() a time; $, number, raised, size, place, placement, save, count, bodies, colours, palette and circle
 * are from there, too. */

/* ---- The engine: the model and the integrators, compiled to WebAssembly.  Workers contain the code down to serve() ---- */

/* The bytes of base64; the loop is ten times as fast as Uint8Array.from with a function. */
function bytesOf (text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const all = atob(text), bytes = new Uint8Array(all.length);
  for (let i = 0; i < all.length; i++) bytes[i] = all.charCodeAt(i);
  return bytes;
}

/* The engine: compressed by gzip, which halves the page and the time to load it, or not. */
async function unpacked (text) {
  const bytes = bytesOf(text), isPacked = bytes[0] === 0x1f;
  return isPacked ? new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer() : bytes;
}

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

class Engine {
  static async open (page, module) {
    const engine = Object.assign(new Engine(), { page, module });
    await engine.restart();
    return engine;
  }

  /* A new instance: at first, and after a run that the engine could not end. */
  async restart () {
    this.wasm = (await WebAssembly.instantiate(this.module, importsOf(this.module))).exports;
    this.wasm._initialize();
    for (const [name, text] of Object.entries(this.page.files)) {
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

  /* Calls begin() with the addresses of the parameters, the initial values and their number; returns the computing time
   * [ms] and the reason of a failure, or "".  s: { method, step, rtol, end, parameters, initial: [[state, value]] }. */
  timed (s, begin) {
    const wasm = this.wasm, parameters = wasm.allocate(8 * s.parameters.length), initial = wasm.allocate(16 * s.initial.length);
    const view = new DataView(wasm.memory.buffer, initial); /* after the allocations, which may replace the buffer */
    this.numbers(parameters, s.parameters.length).set(s.parameters);
    /* a pw_initial_value has 16 bytes: the state at 0, the value at 8 */
    s.initial.forEach(([state, value], i) => { view.setInt32(16 * i, state, true); view.setFloat64(16 * i + 8, value, true); });
    const before = performance.now();
    const status = begin(parameters, initial, s.initial.length);
    const ms = performance.now() - before;
    for (const at of [parameters, initial]) wasm.release(at);
    return { ms, reason: status === 0 ? "" : this.error() };
  }

  /* Integrates with settings for at most `limit` ms. */
  integrate (s, limit, keepSamples) {
    const method = this.text(s.method);
    const result = this.timed(s, (...data) => this.wasm.run(method, s.step, s.rtol, s.end, limit, keepSamples, ...data));
    this.wasm.release(method);
    return result;
  }

  /* The step by rk4+projection with the size h [s] of which t is a part: its samples are four stages, the result before the
   * projection and after it. */
  step (s, h, t, limit) {
    const { reason } = this.timed(s, (...data) => this.wasm.step(h, t, limit, ...data)), scene = this.scene();
    if (reason) throw new Error(reason);
    return this.arrays(scene);
  }

  /* The least of three computing times, without samples [ms]. */
  time (s, limit) {
    return Math.min(...[1, 2, 3].map(() => this.integrate(s, limit, 0).ms));
  }

  /* A run for load(), with its computing time [ms] and statistics. */
  run (s, limit) {
    const tooLarge = this.page.parameters.find((p, i) => p.domain === "count" && s.parameters[i] > 200);
    if (tooLarge) throw new Error(tooLarge.name + " is too large for a page, which takes at most 200; use the program");
    const { ms, reason } = this.integrate(s, limit, 1), scene = this.scene();
    if (!scene || scene.samples < 2) throw new Error(reason || "the run has no samples");
    return { ...scene, ...this.arrays(scene), model: this.page.name, about: this.page.about, method: s.method, link: s.link, reason, ms };
  }

  /* Shapes, number and width of samples, and statistics of the last run; null without one. */
  scene () {
    const at = this.wasm.scene(), scene = at ? JSON.parse(this.read(at)) : null;
    this.wasm.release(at);
    return scene;
  }

  /* The columns of the samples: t, 6 energies; x, y, phi and velocities of bodies; contacts of wheels; forces of links;
   * at the end first-order states and outputs. */
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
      contact: next(3 * scene.wheels.length), force: next(2 * scene.links.length),
      output: columns(width - scene.outputs.length, scene.outputs.length) };
  }

  /* Calls a function of this class; if it fails, the next one has a new instance. */
  async call (name, values) {
    try {
      return this[name](...values);
    } catch (error) {
      await this.restart();
      throw error;
    }
  }
}

/* What a Worker does: opens an engine with its first message, and calls functions of it with the others. */
function serve () {
  let engine;
  onmessage = async ({ data: { name, values } }) => {
    try {
      if (name === "open") engine = await Engine.open(...values);
      const result = name === "open" ? null : await engine.call(name, values);
      postMessage({ result }, Object.values(result ?? {}).filter(ArrayBuffer.isView).map(array => array.buffer));
    } catch (error) {
      postMessage({ error: error.message });
    }
  };
}

/* ---- The Worker, so that the page responds during a run ---- */

const shortRun = 40, usualRun = 4000, longRun = 8000; /* limits of the computing time of a run [ms] */
const patience = 1000; /* for the result of settings that have changed meanwhile [ms] */
const interrupted = new Error("the settings have changed");

/* An engine in a Worker; on this thread if the browser has no Workers.  One call follows the other. */
class Service {
  static async open ({ files: { engine, ...files }, ...page }) {
    const service = new Service(), code = [bytesOf, importsOf, Engine, serve, "serve();"].join("\n");
    service.page = { ...page, files };
    service.url = URL.createObjectURL(new Blob(['"use strict";\n' + code], { type: "text/javascript" }));
    service.last = service.ready = service.start(unpacked(engine).then(bytes => WebAssembly.compile(bytes)));
    await service.ready;
    return service;
  }

  /* compiling: the promise of the module, while the Worker starts. */
  async start (compiling) {
    try {
      this.worker = new Worker(this.url);
      this.worker.onerror = event => { event.preventDefault(); this.worker = null; }; /* until send() has its own */
      this.module = await compiling;
      await this.send("open", [this.page, this.module]);
    } catch (error) {
      this.worker = null;
      this.local = await Engine.open(this.page, this.module = await compiling);
    }
  }

  /* The promise of the result of a message. */
  send (name, values) {
    const worker = this.worker;
    this.since = performance.now();
    return new Promise((resolve, reject) => {
      this.reject = name === "open" ? null : reject;
      worker.onmessage = ({ data }) => data.error === undefined ? resolve(data.result) : reject(new Error(data.error));
      worker.onerror = event => { event.preventDefault(); reject(new Error(event.message || "there is no Worker")); };
      worker.postMessage({ name, values });
    }).finally(() => { this.reject = null; });
  }

  /* The promise of the result of a function of the engine. */
  call (name, ...values) {
    const result = this.last.then(() => this.ready)
      .then(() => this.worker ? this.send(name, values) : this.local.call(name, values));
    this.last = result.catch(() => {});
    return result;
  }

  /* Lets the present call fail if it has taken long, and replaces its Worker, which cannot be stopped otherwise. */
  interrupt () {
    if (!this.worker || !this.reject || performance.now() - this.since < patience) return;
    this.worker.terminate();
    const { reject } = this;
    this.ready = this.start(this.module);
    reject(interrupted);
  }
}

/* ---- The panel ---- */

/* page: the data of the model; settings: those of the panel; runs: { method, accuracy, others, link, ms, error } in the
 * plot, in which `others` are the settings that are not those of the page, apart from method and accuracy. */
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
  return { ...s, parameters: [...s.parameters], initial: otherCounts ? [] : [...s.initial], step: accuracy(s), rtol: accuracy(s),
    link: link(s) };
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

/* Sliders whose ends are to be checked, each with its first value and a function that sets a value in settings. */
let unchecked = [];

/* Moves the ends of sliders towards their first values, by half of the distance up to six times, then to that value, until
 * a run can begin there and does not fail within shortRun. */
async function narrowSliders () {
  const sliders = unchecked;
  for (const { slider, number, value, set } of sliders) {
    const valid = slider.step === "1" ? Math.round : x => x;
    for (const end of ["min", "max"]) {
      let x = Number(slider[end]);
      for (let k = 0; x !== value && !await runsWith(set, x); k++) x = k < 6 ? valid(value + (x - value) / 2) : value;
      if (sliders !== unchecked) return; /* the panel has been filled again */
      slider[end] = Math[end](x, Number(number.value));
    }
    slider.disabled = slider.min === slider.max;
    if (slider.disabled) slider.title = "the model does not run with other values near this one";
  }
  document.documentElement.dataset.narrowed = true;
}

/* Whether the engine can run with the value x of a slider, at least until the limit of computing time stops it. */
async function runsWith (set, x) {
  const s = pageSettings();
  set(s, x);
  try {
    return /^(stopped at.*)?$/.test((await engine.call("integrate", engineSettings(s), shortRun, 0)).reason);
  } catch (error) {
    return error === interrupted ? runsWith(set, x) : false;
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
    ...control(parent, quantity.name, quantity.unit, about, value, ...rangeOf(first, domain), x => { set(settings, x); simulate(); }) });
  unchecked = [];
  delete document.documentElement.dataset.narrowed;
  page.parameters.forEach((p, i) => add($("parameters"), p, p.about, settings.parameters[i], p.value, p.domain,
    (s, x) => { s.parameters[i] = x; }));
  page.states.forEach((state, i) => state.name && add($("states"), state, "", settings.initial.get(i) ?? state.value, state.value, "real",
    (s, x) => s.initial.set(i, x)));
  $("parameters").hidden = page.parameters.length === 0;
  fillAccuracy();
}

/* The buttons of the runs that the model offers. */
function fillPresets () {
  $("presets").hidden = page.presets.length === 0;
  $("page-presets").replaceChildren(...page.presets.map(({ name, about, settings }) => {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: name, title: about });
    const link = new URLSearchParams(settings.split(" ").map(word => word.split("=")).map(([key, value]) =>
      [["step", "rtol"].includes(key) ? "accuracy" : key, value]));
    button.addEventListener("click", () => { $("page-preset").textContent = about; use(link.toString(), true); });
    return button;
  }));
}

function fillAccuracy () {
  const adaptive = byName(settings.method).adaptive;
  $("page-accuracy-name").textContent = adaptive ? "Tolerance" : "Step size [s]";
  const power = x => Math.floor(Math.log10(x));
  $("page-accuracy").min = adaptive ? -12 : Math.min(-5, power(page.step) - 1);
  $("page-accuracy").max = adaptive ? -2 : Math.min(-1, power(page.t_end) - 1);
  $("page-accuracy").step = adaptive ? 0.5 : 0.25;
  $("page-accuracy").value = Math.log10(accuracy(settings));
  showAccuracy();
}
/* The sliders are logarithmic: their values in words. */
function showAccuracy () { showValue("page-accuracy", rounded(accuracy(settings))); }
function showValue (slider, text) {
  $(slider + "-value").textContent = text;
  $(slider).setAttribute("aria-valuetext", text);
}

/* ---- Runs ---- */

/* The largest difference of x, y [m] and phi [rad] of the bodies at the end. */
function difference (a, b) {
  let most = 0;
  for (let k = 0; k < 6 * a.bodies.length; k++)
    if (k % 6 < 3) most = Math.max(most, Math.abs(a.motion[a.motion.length - 6 * a.bodies.length + k] - b.motion[b.motion.length - 6 * b.bodies.length + k]));
  return most;
}

/* Runs with the settings of the panel, and again if they have changed meanwhile. */
let changes = 0; /* of settings */
let refit = false; /* the next run changes the view */
let simulating = false, estimateTimer = 0;
async function simulate () {
  if (!engine) return; /* not yet */
  changes++;
  clearTimeout(estimateTimer);
  document.documentElement.dataset.simulated = "";
  engine.interrupt();
  if (simulating) return;
  simulating = true;
  try {
    for (let last; last !== changes;) await showRun(last = changes);
  } finally {
    simulating = false;
  }
}

/* Shows the result of the settings after this change, or after the next one if they have changed meanwhile: a slider that
 * is dragged shows every run that is ready.  If they are the last ones and the run was complete, estimates its error
 * 300 ms later. */
async function showRun (change) {
  const used = engineSettings(settings);
  let result;
  try {
    result = await engine.call("run", used, usualRun);
  } catch (error) {
    if (change !== changes) return;
    $("reason").textContent = error.message + (run ? ". The run before it is still shown." : "");
    document.documentElement.dataset.simulated = "error";
    return;
  }
  const t = state.t;
  oneStep = null; /* of other settings */
  if (run) { load(result); if (refit) fit(); refit = false; fillFamilies(); key(); seek(t); } else begin(result);
  showCost(result, result.reason ? undefined : null);
  showValues();
  if (change !== changes) return;
  if (!document.querySelector("#panel input:active")) setAddress();
  document.documentElement.dataset.simulated = "yes";
  if (!result.reason) estimateTimer = setTimeout(() => estimate(result, used, change), 300);
}

/* While a slider is held, the address does not change: browsers refuse more than a few changes per second. */
function setAddress () {
  const address = "#" + link(settings);
  if (address === (location.hash || "#")) return;
  try {
    history.replaceState(null, "", address);
  } catch (error) {
    $("page-link").hidden = true; /* in a frame of another document the page has no address of its own */
  }
}

/* Estimates the error of the result of these settings by a reference: erk8+projection with a tolerance of 1e-13. */
async function estimate (result, used, change) {
  try {
    const reference = await engine.call("run", { ...used, method: "erk8+projection", rtol: 1e-13 }, longRun);
    if (change !== changes) return;
    if (reference.reason) throw new Error(reference.reason);
    result.ms = Math.max(await engine.call("time", used, longRun), 0.01); /* logarithmic axes have no 0 */
    if (change !== changes) return;
    const error = difference(result, reference);
    addRun(used, result.ms, Math.max(error, 1e-16));
    showCost(result, error);
    document.documentElement.dataset.estimated = error;
  } catch (error) {
    if (change === changes) showCost(result, undefined); /* there is no reference */
  }
}

/* Adds a run to the plot, in place of one with the same settings. */
const mostRuns = 200;
function addRun ({ method, step, link }, ms, error) {
  const others = new URLSearchParams(link);
  others.delete("method");
  others.delete("accuracy");
  const added = { method, accuracy: step, others: [...others].map(pair => pair.join(" = ")).join(", "), link, ms, error };
  const same = r => ["method", "accuracy", "others"].every(key => r[key] === added[key]);
  runs = [...runs.filter(r => !same(r)).slice(1 - mostRuns), added];
}

/* The runs by the same method with the same parameters, by accuracy: one list for each curve. */
function curvesOfRuns () {
  const curves = new Map();
  for (const r of runs) {
    const name = r.method + " " + r.others;
    curves.set(name, [...(curves.get(name) || []), r]);
  }
  return [...curves.values()].map(curve => curve.sort((a, b) => b.accuracy - a.accuracy));
}

function fillTable (id, list) {
  $(id).replaceChildren(...list.map(([name, value]) => {
    const row = document.createElement("tr");
    row.append(Object.assign(document.createElement("th"), { scope: "row", textContent: name }),
      Object.assign(document.createElement("td"), { textContent: value }));
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

/* One colour for each method; dashes by stabilisation. */
const methodColours = ["#7a4f2a", "#cc6622", "#e0556a", "#b08a00", "#808080", "#2299bb", "#228833", "#66a61e",
  "#5b45c8", "#d35fc6", "#3a74b4", "#aa3377",
  "#b01020", "#ff8c5a", "#d04a00", "#00a88f", "#57c7c0", "#8a7bd8", "#2f2f8f"];
function methodPen (method) {
  const i = page.methods.findIndex(m => m.name === method);
  return { colour: methodColours[i % methodColours.length], dash: dashes[i % dashes.length], sign: dashSigns[i % dashes.length] };
}

/* Error over computing time, both logarithmic; the last run is filled, curves of other parameters are faint. */
function plotRuns () {
  const area = size($("page-plot")), g = area.g, curves = curvesOfRuns(), last = runs[runs.length - 1];
  g.clearRect(0, 0, area.width, area.height);
  fillRunKey(curves);
  if (!last) return;
  const logs = pick => runs.map(p => Math.log10(p[pick])), box = list => [Math.floor(Math.min(...list) - 0.2), Math.ceil(Math.max(...list) + 0.2)];
  const [x0, x1] = box(logs("ms")), [y0, y1] = box(logs("error"));
  const X = x => 38 + (area.width - 48) * (x - x0) / (x1 - x0), Y = y => area.height - 26 - (area.height - 36) * (y - y0) / (y1 - y0);
  g.font = "11px system-ui, sans-serif";
  g.lineWidth = 1;
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
  for (const curve of curves) {
    const pen = methodPen(curve[0].method), points = curve.map(r => [X(Math.log10(r.ms)), Y(Math.log10(r.error))]);
    g.strokeStyle = g.fillStyle = pen.colour;
    g.lineWidth = 1.5;
    g.globalAlpha = curve[0].others === last.others ? 1 : 0.35;
    g.setLineDash(pen.dash);
    strokePath(g, points);
    g.setLineDash([]);
    points.forEach(([x, y], i) => {
      g.beginPath();
      g.arc(x, y, curve[i] === last ? 5 : 3.5, 0, circle);
      curve[i] === last ? g.fill() : g.stroke();
    });
  }
  g.globalAlpha = 1;
}

/* The legend of the plot: a button for each curve, which sets the settings of its most accurate run. */
function fillRunKey (curves) {
  $("page-curves").replaceChildren(...curves.map(curve => {
    const button = document.createElement("button"), pen = methodPen(curve[0].method), { link } = curve[curve.length - 1];
    button.type = "button";
    button.textContent = pen.sign + " " + curve[0].method + (curve[0].others && ": " + curve[0].others);
    button.style.color = pen.colour;
    button.title = "use the settings of its most accurate run";
    button.addEventListener("click", () => use(link));
    return button;
  }));
}

/* ---- Another run, B, beside the one that is shown, A ---- */

let kept = null; /* B: a run and its settings as `link`; null: none */

const nameOf = (method, link) => [method, ...[...new URLSearchParams(link)].filter(([key]) => key !== "method").map(([key, value]) =>
  (key !== "accuracy" ? key : byName(method).adaptive ? "tolerance" : "step size") + " = " + value)].join(", ");
/* B has the same bodies: with other counts in the model they cannot be compared. */
const comparable = () => kept && kept.motion.length / kept.t.length === run.motion.length / run.t.length;

function keep (other) {
  kept = other;
  $("page-kept").textContent = kept ? "B: " + nameOf(kept.method, kept.link) : "";
  $("page-swap").hidden = $("page-drop").hidden = !kept;
  families = allFamilies();
  fillFamilies();
  if (kept && comparable()) $("which").value = moreFamilies()[0].name;
  key();
  draw();
}

/* The differences of both runs at the samples of A; those of B are at the same times, or interpolated. */
function differences () {
  if (!comparable()) return [];
  const places = [...run.t].map(t => place(Math.min(t, kept.t[kept.t.length - 1]), kept));
  const apart = (b, i) => placement(b, places[i], kept).map((x, k) => run.motion[6 * (i * bodies + b) + k] - x);
  const distance = (b, i) => Math.hypot(...apart(b, i).slice(0, 2)), each = at => run.bodies.slice(0, 8).map((body, b) => ({ name: body.name, at: i => at(b, i) }));
  return [{ name: "distance of A and B, power of ten", unit: "m", curves: each((b, i) => Math.log10(Math.max(distance(b, i), 1e-17))) },
    { name: "distance of A and B", unit: "m", curves: each(distance) }, { name: "angle of A less that of B", unit: "rad", curves: each((b, i) => apart(b, i)[2]) }];
}

function drawKept (g, s, X, Y) {
  if (!comparable()) return;
  const at = place(state.t, kept);
  g.globalAlpha = 0.7;
  drawBodies(g, X, Y, run.bodies.map((body, b) => placement(b, at, kept)), colours.trace);
  g.globalAlpha = 1;
  g.font = "12px system-ui, sans-serif";
  g.fillStyle = colours.body;
  g.fillText("A: " + nameOf(run.method, run.link), 40, s.height - 36);
  g.fillStyle = colours.trace;
  g.fillText("B: " + nameOf(kept.method, kept.link), 40, s.height - 20);
}

/* ---- One step of rk4+projection ---- */

let oneStep = null;   /* the samples of Engine.step, of the time shown; null: not asked for, or not yet known */
let stepping = false; /* one is being computed */
const stepOn = () => $("page-step").getAttribute("aria-pressed") === "true";
const stepSize = () => Number(Math.pow(10, Number($("page-step-size").value)).toPrecision(2));

/* The step around the time shown, if it is not yet known. */
async function findStep () {
  if (stepping || !engine || (oneStep && oneStep.h === stepSize() && oneStep.t[0] <= state.t && state.t < oneStep.t[4])) return;
  const t = state.t, h = stepSize();
  stepping = true;
  try {
    oneStep = { ...await engine.call("step", engineSettings(settings), h, t, usualRun), h };
    $("page-step-error").textContent = "";
  } catch (error) {
    oneStep = null;
    if (error !== interrupted) $("page-step-error").textContent = error.message;
  }
  stepping = false;
  showStep();
  draw();
}

/* x, y, phi of each body in sample i of the step, and their changes by the projection. */
const placesOfStep = i => run.bodies.map((body, b) => [0, 1, 2].map(k => oneStep.motion[6 * (i * bodies + b) + k]));
const motionOfStep = (from, to) => placesOfStep(to).map((p, b) => p.map((x, k) => x - placesOfStep(from)[b][k]));
const corrections = () => motionOfStep(4, 5);

function showStep () {
  if (!oneStep) return fillTable("page-step-values", []);
  const all = corrections(), most = list => Math.max(...list.map(c => Math.hypot(c[0], c[1])));
  fillTable("page-step-values", [["from t [s]", number(oneStep.t[0], 1e-6)], ["to t [s]", number(oneStep.t[4], 1e-6)],
    ["largest motion of a body [m]", rounded(most(motionOfStep(0, 5)))],
    ["largest correction of a position [m]", rounded(most(all))],
    ["largest correction of an angle [rad]", rounded(Math.max(...all.map(c => Math.abs(c[2]))))]]);
}

const stepNames = ["stage 1: the state reached", "stage 2: half a step along stage 1", "stage 3: half a step along stage 2",
  "stage 4: a step along stage 3", "result: the mean of the stages", "projected onto the constraints"];
function drawStep (g, s, X, Y) {
  findStep();
  if (!oneStep) return;
  g.font = "12px system-ui, sans-serif";
  stepNames.forEach((name, i) => {
    const colour = i < 4 ? palette[i] : i === 4 ? colours.force : colours.ink;
    g.globalAlpha = i < 4 ? 0.55 : 1;
    drawBodies(g, X, Y, placesOfStep(i), colour);
    g.globalAlpha = 1;
    g.fillText(name, 40, s.height - 20 - 16 * (stepNames.length - i));
  });
  drawCorrections(g, s, X, Y);
}

/* The corrections of centres of mass as arrows, magnified by a power of ten so that they are visible. */
function drawCorrections (g, s, X, Y) {
  const all = corrections(), most = Math.max(...all.map(c => Math.hypot(c[0], c[1])));
  if (!(most * view.scale > 1e-14 * s.width)) return g.fillText("the projection changes no position", 40, s.height - 20);
  const power = Math.floor(Math.log10(60 / (most * view.scale))), factor = Math.pow(10, Math.max(0, power));
  g.strokeStyle = g.fillStyle = colours.force;
  g.lineWidth = 2;
  g.setLineDash([3, 2]);
  all.forEach((c, b) => {
    const [x, y] = placesOfStep(4)[b];
    strokePath(g, [[X(x), Y(y)], [X(x + factor * c[0]), Y(y + factor * c[1])]]);
  });
  g.setLineDash([]);
  g.fillText("dashed: corrections of positions" + (power > 0 ? ", 10" + raised(power) + " times as long" : ""), 40, s.height - 20);
}

/* ---- Links, files, controls ---- */

/* What differs from the page's own settings, as in "method=rk4+projection&a=0.7&start.frame.x=1". */
function link (settings) {
  const list = new URLSearchParams();
  if (settings.method !== page.method) list.set("method", settings.method);
  if (settings.accuracy !== null) list.set("accuracy", settings.accuracy);
  if (settings.end !== page.t_end) list.set("t_end", settings.end);
  page.parameters.forEach((p, i) => { if (settings.parameters[i] !== p.value) list.set(p.name, settings.parameters[i]); });
  for (const [i, value] of settings.initial)
    if (!page.states[i].given || value !== page.states[i].value) list.set("start." + page.states[i].name, value);
  return list.toString();
}

/* Sets the settings from an address, as link() writes them. */
function readLink (text) {
  const list = new URLSearchParams(text), number = (key, otherwise, low = -Infinity) => {
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

/* Simulates with the settings of an address; fits: whether the view then shows the whole motion. */
function use (text, fits = false) {
  refit = fits;
  readLink(text);
  fillPanel();
  simulate();
  narrowSliders();
}

function csv () {
  const names = run.bodies.flatMap(body => ["x [m]", "y [m]", "phi [rad]", "vx [m/s]", "vy [m/s]", "omega [rad/s]"].map(n => body.name + "." + n));
  const more = run.outputs.map(({ name, unit }) => name + (unit && " [" + unit + "]")), n = more.length;
  const lines = [["t [s]", ...names, ...more].join(",")];
  for (let i = 0; i < count; i++)
    lines.push([run.t[i], ...run.motion.subarray(6 * i * bodies, 6 * (i + 1) * bodies), ...run.output.subarray(i * n, (i + 1) * n)].join(","));
  return lines.join("\n") + "\n";
}

function showStepSize () { showValue("page-step-size", number(stepSize(), stepSize() / 100) + " s"); }

function addListeners () {
  $("page-step-size").min = Math.floor(Math.log10(page.t_end)) - 6;
  $("page-step-size").max = Math.floor(Math.log10(page.t_end)) - 0.5;
  $("page-step-size").value = Math.log10(Math.min(100 * page.step, page.t_end / 20));
  showStepSize();
  $("page-method").addEventListener("change", e => { settings.method = e.target.value; settings.accuracy = null; fillAccuracy(); simulate(); });
  $("page-accuracy").addEventListener("input", e => {
    settings.accuracy = Number(Math.pow(10, Number(e.target.value)).toPrecision(3));
    showAccuracy();
    simulate();
  });
  $("page-end").addEventListener("change", e => { if (Number(e.target.value) > 0) { settings.end = Number(e.target.value); simulate(); } });
  $("panel").addEventListener("change", setAddress);
  $("page-reset").addEventListener("click", () => { runs = []; use("", true); });
  $("page-clear").addEventListener("click", () => { runs = []; plotRuns(); });
  $("page-csv").addEventListener("click", () => save(page.name + ".csv", new Blob([csv()], { type: "text/csv" })));
  $("page-link").addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(location.href);
      $("page-copied").textContent = "copied";
    } catch (error) {
      $("page-copied").textContent = "copy the address of this page";
    }
  });
  $("page-keep").addEventListener("click", () => run && keep({ ...run }));
  $("page-drop").addEventListener("click", () => keep(null));
  $("page-swap").addEventListener("click", () => { const { link } = kept; keep({ ...run }); use(link); });
  $("page-step").addEventListener("click", () => {
    $("page-step").setAttribute("aria-pressed", !stepOn());
    $("page-step-box").hidden = !stepOn();
    if (stepOn() && !state.follow) $("follow").click(); else draw(); /* a step is small beside the whole motion */
  });
  $("page-step-size").addEventListener("input", () => { showStepSize(); draw(); });
  $("page-step-next").addEventListener("click", () => seek(oneStep ? oneStep.t[4] : state.t + stepSize()));
  $("page-step-back").addEventListener("click", () => seek(oneStep ? Math.max(0, oneStep.t[0] - stepSize() / 2) : state.t));
  $("values").addEventListener("toggle", showValues);
  $("scrub").addEventListener("input", showValues);
  window.addEventListener("resize", plotRuns);
  window.addEventListener("hashchange", () => { if (location.hash.slice(1) !== link(settings)) use(location.hash.slice(1)); });
}

/* Starts the page with the data that page.c writes. */
async function start_page (data) {
  page = data;
  const opening = typeof WebAssembly === "object" && typeof DecompressionStream === "function" && Service.open(page);
  $("model").textContent = page.name;
  $("about").textContent = page.about;
  readLink(location.hash.slice(1));
  moreFamilies = differences;
  overlay = (...where) => stepOn() ? drawStep(...where) : drawKept(...where);
  instead = () => stepOn() && oneStep ? placesOfStep(5) : null;
  fillPanel();
  fillPresets();
  addListeners();
  if (!opening) {
    $("reason").textContent = "This page simulates with WebAssembly and DecompressionStream, which this browser lacks or has switched off.";
    return;
  }
  try {
    engine = await opening;
    simulate();
    narrowSliders();
  } catch (error) {
    $("reason").textContent = error.message;
  }
}
