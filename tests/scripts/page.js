/* What tests/scripts/page.sh puts at the end of an interactive page: it uses the controls and writes the values that the page
 * displays at the end of the run as the text of an element "verdict", or what went wrong. */
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
    await change("#page-method", "erk5+projection", "change");
    await change("#page-accuracy", "-9", "input");
    await change('#parameters input[type=number][data-name="' + wanted.name + '"]', wanted.value, "change");
    if (!location.hash.includes(wanted.name + "=" + wanted.value)) throw new Error("the address lacks the parameter: " + location.hash);
    if (!location.hash.includes("accuracy=1e-9")) throw new Error("the address lacks the tolerance: " + location.hash);
    document.dispatchEvent(new KeyboardEvent("keydown", { key: "End", bubbles: true }));
    $$("#values").open = true;
    await until("the table of values", () => $$("#page-values tr"));
    text = [...document.querySelectorAll("#page-values tr")].map(row => row.cells[0].textContent + " " + row.cells[1].textContent).join("\n");
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
