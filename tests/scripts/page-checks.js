/* Checks that tests/scripts/page.sh adds to an interactive page, before page.js: they use the controls and throw an error
 * for what is wrong.  change (selector, value, event) sets a control and awaits the run, until (what, good) a condition. */

const demand = (what, good) => { if (!good) throw new Error(what); };
const later = ms => new Promise(done => setTimeout(done, ms));

/* The plot of errors: a colour for each method, curves of runs with the same parameters, a button that clears it. */
async function checkPlot (change, until) {
  const root = document.documentElement.dataset, keys = () => [...$("page-curves").children];
  const estimated = async (selector, value, event) => {
    delete root.estimated;
    await change(selector, value, event);
    await until("the error by " + value, () => root.estimated !== undefined);
  };
  const rgb = key => getComputedStyle(key).color.match(/[\d.]+/g).slice(0, 3).map(Number);
  const plot = $("page-plot"), g = plot.getContext("2d"), copy = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const drawn = () => {
    Object.assign(copy.canvas, { width: plot.width, height: plot.height });
    copy.drawImage(plot, 0, 0);
    return copy.getImageData(0, 0, plot.width, plot.height).data;
  };
  const pixels = colour => { /* how many have this colour */
    const data = drawn();
    let n = 0;
    for (let i = 0; i < data.length; i += 4) n += data[i + 3] === 255 && colour.every((c, k) => Math.abs(c - data[i + k]) < 2);
    return n;
  };
  $("page-clear").click();
  demand("cleared runs are in the plot", keys().length === 0 && !drawn().some(x => x));
  for (const m of page.methods) {
    await estimated("#page-method", m.name, "change");
    demand("the last run, by " + m.name + ", is no filled point of its colour", pixels(rgb(keys().pop())) > 40);
  }
  demand("not every method has a curve: " + keys().map(key => key.textContent), keys().length === page.methods.length);
  const colours = keys().map(rgb);
  for (const [i, a] of colours.entries())
    for (const b of colours.slice(0, i)) demand("two methods look alike: " + a + "; " + b, Math.hypot(...a.map((x, k) => x - b[k])) > 40);

  let lines = 0; /* from point to point of the last method */
  const lineTo = g.lineTo, last = "erk8+nullspace", name = page.parameters[0].name;
  const colour = methodPen(last).colour;
  g.lineTo = function (x, y) { lines += this.strokeStyle === colour; lineTo.call(this, x, y); };
  await change("#page-method", last, "change");
  for (const tolerance of [-8, -4, -7, -8]) await estimated("#page-accuracy", tolerance, "input");
  lines = 0;
  plotRuns();
  demand("runs by one method with four tolerances are no curve: " + lines, lines === 3 && keys().length === page.methods.length);
  const field = '#parameters input[type=number][data-name="' + name + '"]', first = document.querySelector(field).value, other = first * 1.01;
  await estimated(field, other, "change");
  lines = 0;
  plotRuns();
  demand("a run with another parameter continues a curve", lines === 3 && keys().length === page.methods.length + 1);
  demand("it does not carry its parameter: " + keys().pop().textContent, keys().pop().textContent.includes(name + " = " + other));
  keys()[0].click();
  await until("the settings of a curve", () => root.simulated === "yes" && document.querySelector(field).value === first);
  demand("a curve sets another method: " + $("page-method").value, $("page-method").value === page.methods[0].name);
  $("page-reset").click();
  await until("the reset", () => root.simulated === "yes" && keys().length === 0);
}

/* Runs do not block the page; of values that follow each other during one, the last is shown; a run that takes long is
 * given up when the settings change. */
async function checkWorker (change, until) {
  const root = document.documentElement.dataset, name = page.parameters[0].name, call = engine.call;
  const slider = document.querySelector('#parameters input[type=range][data-name="' + name + '"]');
  const set = x => { slider.value = x; slider.dispatchEvent(new Event("input", { bubbles: true })); };
  const low = page.parameters[0].value, values = [...Array(20).keys()].map(i => low * (1 + 0.002 * i));
  let asked = 0, seen = 0; /* runs; values set during a run */
  engine.call = function (name, ...rest) { asked += name === "run"; return call.call(engine, name, ...rest); };
  await change("#page-method", "rk4+projection", "change");
  await change("#page-accuracy", -4, "input");
  asked = 0;
  for (const x of values) {
    set(x);
    await later(0);
    seen += root.simulated === "";
  }
  demand("the page does not respond during a run", seen > 10);
  await until("the last run", () => root.simulated === "yes");
  demand("every value has a run: " + asked, asked < values.length);
  const shown = csv(), text = slider.value;
  await change("#page-accuracy", -3.5, "input");
  await change("#page-accuracy", -4, "input");
  demand("the last value is not shown", slider.value === text && csv() === shown);
  const { worker } = engine;
  set(low);
  await until("the run", () => engine.reject);
  engine.since -= 1e6; /* as if it had begun long ago */
  await change("#page-method", "erk8+projection", "change");
  demand("a run that takes long is awaited", engine.worker && engine.worker !== worker);
  demand("another run is shown: " + run.method, run.method === "erk8+projection");
  engine.call = call;
  $("page-reset").click();
  await until("the reset", () => root.simulated === "yes" && run.method === page.method);
}

/* A second run beside the first, curves over curves, a step with its stages, the model's own settings. */
async function checkLesson (change, until) {
  const root = document.documentElement.dataset, families = () => [...$("which").options].map(o => o.value);
  const choose = (id, name) => { $(id).value = name; $(id).dispatchEvent(new Event("change", { bubbles: true })); };
  await change("#page-method", "rk4+none", "change");
  await change("#page-accuracy", -1.5, "input");
  $("page-keep").click();
  const before = csv().split("\n"), first = families().length;
  await change("#page-method", "radau+ggl", "change");
  demand("B is not named by its step: " + $("page-kept").textContent, /^B: rk4\+none, step size = 0.0316/.test($("page-kept").textContent));
  demand("no differences: " + families(), $("which").value.startsWith("distance of A and B") && families().length === first);
  const rows = [before, csv().split("\n")].map(lines => lines[lines.length - 2].split(",").map(Number));
  choose("which", "distance of A and B");
  const apart = chosen()[0].curves[0].at(count - 1), expected = Math.hypot(rows[0][1] - rows[1][1], rows[0][2] - rows[1][2]);
  demand("a distance at the end of " + apart + ", not " + expected, expected > 0 && Math.abs(apart - expected) < 1e-12);
  demand("runs begin at different places", chosen()[0].curves[0].at(0) === 0);
  $("page-swap").click();
  await until("the other run", () => root.simulated === "yes" && run.method === "rk4+none");
  demand("B is not the former A: " + $("page-kept").textContent, $("page-kept").textContent.includes("radau+ggl"));
  $("page-drop").click();
  demand("differences of one run", families().length === first - 3);
  choose("which", "angular velocity");
  choose("over", "angle");
  const box = $("curves").getBoundingClientRect(), i = Math.floor(count / 3), [x, y] = pixelsOf(0, i);
  $("curves").dispatchEvent(new PointerEvent("pointerdown", { clientX: box.left + x, clientY: box.top + y, pointerId: 1 }));
  demand("a point of a phase plot has another time: " + state.t, run.motion[6 * nearest(state.t) * bodies + 5] === run.motion[6 * i * bodies + 5]);
  choose("over", "time");

  $("page-step").click();
  $("page-step-size").value = Math.log10(0.05);
  $("page-step-size").dispatchEvent(new Event("input", { bubbles: true }));
  seek(0.52);
  await until("a step", () => oneStep && oneStep.h === 0.05 && !stepping);
  demand("the step size in words: " + $("page-step-size").getAttribute("aria-valuetext"), $("page-step-size").getAttribute("aria-valuetext") === "0.05 s");
  demand("the view is not near the step", state.follow);
  const h = 0.05, m = oneStep.motion, at = (i, k) => m[6 * i * bodies + k];
  demand("a step from " + oneStep.t[0], Math.abs(oneStep.t[0] - 0.5) < 1e-9 && Math.abs(oneStep.t[4] - 0.55) < 1e-9);
  for (let b = 0; b < bodies; b++)
    for (let k = 6 * b; k < 6 * b + 3; k++) {
      demand("stage 2 is not half a step along stage 1", Math.abs(at(1, k) - at(0, k) - h / 2 * at(0, k + 3)) < 1e-13);
      const mean = at(0, k) + h / 6 * (at(0, k + 3) + 2 * at(1, k + 3) + 2 * at(2, k + 3) + at(3, k + 3));
      demand("the result is not the mean of the stages", Math.abs(at(4, k) - mean) < 1e-12);
    }
  const whole = await engine.call("run", { ...engineSettings(settings), method: "rk4+projection", step: h, end: 0.55 }, usualRun);
  for (let k = 0; k < 6 * bodies; k++)
    demand("the projected state is not that of a run", Math.abs(at(5, k) - whole.motion[whole.motion.length - 6 * bodies + k]) < 1e-9);
  $("page-step-next").click();
  await until("the next step", () => oneStep && Math.abs(oneStep.t[0] - 0.55) < 1e-9);
  $("page-step").click();

  for (const button of $("page-presets").children) {
    root.simulated = "";
    button.click();
    await until("the run of " + button.textContent, () => root.simulated === "yes");
    const shown = { ...view };
    fit();
    demand("the view is not that of the new motion", shown.scale === view.scale);
    demand("its settings are not in the address", location.hash.length > 1 && $("page-preset").textContent === button.title);
  }
  const { call } = engine;
  engine.call = (name, s, ...rest) => name === "run" && s.rtol === 1e-13 ? Promise.reject(new Error("as wanted")) : call.call(engine, name, s, ...rest);
  await change("#page-method", "erk5+projection", "change");
  await until("an error without a reference", () => $("page-results").querySelector("td").textContent === "unknown");
  engine.call = call;
  demand("the model offers no runs", $("page-presets").children.length > 0);
  $("page-reset").click();
  await until("the reset", () => root.simulated === "yes" && run.method === page.method);
}

/* In a frame as wide as a phone: the verdict on sliders, picture and help. */
async function checkPhone () {
  const wrong = [], sliders = [...document.querySelectorAll("input[type=range]")], box = item => item.getBoundingClientRect();
  for (const details of document.querySelectorAll("details")) details.open = true;
  if ($("page-step")) $("page-step").click();
  for (const slider of sliders) {
    slider.scrollIntoView({ block: "nearest" });
    await later(20);
    const name = slider.dataset.name || slider.id, s = box(slider), scene = box($("scene"));
    if (s.height < 40) wrong.push(name + " is low: " + s.height);
    if (s.width < 90) wrong.push(name + " is short: " + s.width);
    if (document.elementFromPoint(s.left + s.width / 2, s.top + s.height / 2) !== slider) wrong.push(name + " is covered");
    if (scene.top < 0 || scene.bottom > innerHeight || scene.height < 150) wrong.push("the picture is not visible with " + name);
  }
  if (box($("help")).height > 0) wrong.push("the help for keyboards is displayed");
  if (document.documentElement.scrollWidth > innerWidth) wrong.push("the page is too wide");
  return innerWidth + " " + sliders.length + " " + (wrong.join("; ") || "good");
}
