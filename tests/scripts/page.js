/* tests/scripts/page.sh appends this script to an interactive page.  It uses the controls and writes into an element
 * "verdict" the values that the page displays at the end of the run, or "wrong" and what failed.  wanted: name and value of
 * the parameter to change. */
(async () => {
  const root = document.documentElement.dataset, $$ = selector => document.querySelector(selector);
  const until = async (what, good) => {
    for (let i = 0; i < 500; i++) { if (good()) return; await new Promise(done => setTimeout(done, 20)); }
    throw new Error(what + " did not happen: " + $$("#reason").textContent);
  };
  const change = async (selector, value, event) => {
    root.simulated = "";
    $$(selector).value = value;
    $$(selector).dispatchEvent(new Event(event, { bubbles: true }));
    await until(selector, () => root.simulated === "yes");
  };
  let text;
  try {
    await until("the first run", () => root.simulated === "yes");
    await until("its error", () => root.estimated !== undefined);
    const call = engine.call, ends = [], end = settings.end; /* ends: final times of the runs */
    const count = (name, s, ...rest) => { if (name === "run") ends.push(s.end); return call.call(engine, name, s, ...rest); };
    engine.call = count;
    simulate();
    await until("a run", () => root.simulated === "yes");
    settings.end = end / 2;
    await until("the run of reference", () => ends.length === 2);
    settings.end = end;
    if (ends[1] !== end) throw new Error("the reference has other settings than the run: " + ends);
    simulate();
    await until("a run", () => root.simulated === "yes");
    engine.call = () => Promise.reject(new Error("as wanted"));
    simulate();
    await until("a failure", () => root.simulated === "error");
    engine.call = count;
    await new Promise(done => setTimeout(done, 500));
    if (ends.length !== 3) throw new Error("the error of a run is estimated after another one has failed");
    engine.call = call;
    if (!page.methods.some(m => m.name === "erk8+nullspace")) throw new Error("a method is missing");
    if (window.checkPlot) await checkPlot(change, until);
    if (window.checkWorker) await checkWorker(change, until);
    if (window.checkLesson) await checkLesson(change, until);
    await change("#page-method", "erk5+projection", "change");
    await change("#page-accuracy", "-9", "input");
    await change('#parameters input[type=number][data-name="' + wanted.name + '"]', wanted.value, "change");
    const field = $$('#parameters input[type=number][data-name="' + wanted.name + '"]');
    field.value = "";
    field.dispatchEvent(new Event("change", { bubbles: true }));
    if (Number(field.value) !== wanted.value) throw new Error("without a number, a field does not show the value that is set: " + field.value);
    if (!location.hash.includes(wanted.name + "=" + wanted.value)) throw new Error("the address lacks the parameter: " + location.hash);
    if (!location.hash.includes("accuracy=1e-9")) throw new Error("the address lacks the tolerance: " + location.hash);
    document.dispatchEvent(new KeyboardEvent("keydown", { key: "End", bubbles: true }));
    $$("#values").open = true;
    await until("the table of values", () => $$("#page-values tr"));
    const exact = csv().trim().split("\n").pop().split(",").slice(1).filter((x, k) => k % 6 < 3);
    text = [...document.querySelectorAll("#page-values tr")]
      .map((row, k) => row.cells[0].textContent + " " + row.cells[1].textContent + " " + exact[k]).join("\n");
    const shown = location.hash;
    location.hash = "#method=%3C/script%3E&accuracy=-1&t_end=0&start.x=1&__proto__=1&" + wanted.name + "=1e999";
    await until("the reading of a senseless address", () => root.simulated === "yes" && location.hash !== shown && !location.hash.includes("e999"));
    if (location.hash.length > 1) throw new Error("a senseless address has an effect: " + location.hash);
    location.hash = shown;
    await until("the settings of an address", () => root.simulated === "yes" && $$("#page-method").value === "erk5+projection");
    if (Number($$('#parameters input[type=number][data-name="' + wanted.name + '"]').value) !== wanted.value) throw new Error("the address is not read");
    await until("ends of sliders that work", () => root.narrowed);
    for (const end of ["min", "max"]) {
      const slider = '#parameters input[type=range][data-name="' + wanted.name + '"]';
      await change(slider, $$(slider)[end], "input");
    }
    $$("#page-reset").click();
    await until("the reset", () => root.simulated === "yes" && $$("#page-method").value !== "erk5+projection");
  } catch (error) {
    text = "wrong " + error.message;
  }
  const pre = document.createElement("pre");
  pre.id = "verdict";
  pre.textContent = "\n" + text + "\n";
  document.body.append(pre);
})();
