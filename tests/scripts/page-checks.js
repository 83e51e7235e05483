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
  const lineTo = g.lineTo, last = page.methods[page.methods.length - 1].name, name = page.parameters[0].name;
  const colour = methodPen(last).colour;
  g.lineTo = function (x, y) { lines += this.strokeStyle === colour; lineTo.call(this, x, y); };
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

/* In a frame as wide as a phone: the verdict on sliders, picture and help. */
async function checkPhone () {
  const wrong = [], sliders = [...document.querySelectorAll("input[type=range]")], box = item => item.getBoundingClientRect();
  for (const details of document.querySelectorAll("details")) details.open = true;
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
