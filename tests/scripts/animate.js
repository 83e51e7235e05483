/* tests/scripts/animate.sh appends this script to an animation.  It uses the controls of the page and writes the result
 * into an element "verdict": "ok", or the expectations that fail.  Frames follow the clock of tests/scripts/animate.sh. */
(async () => {
  const failures = [], root = document.documentElement.dataset, time = () => Number(root.time);
  const expect = (what, good) => { if (!good) failures.push(what); };
  const press = (key, more) => document.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, ...more }));
  const wait = ms => new Promise(done => setTimeout(done, ms));
  const copy = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const drawn = () => { // a checksum of the pixels
    const canvas = document.getElementById("scene");
    copy.canvas.width = canvas.width;
    copy.canvas.height = canvas.height;
    copy.drawImage(canvas, 0, 0);
    const data = copy.getImageData(0, 0, canvas.width, canvas.height).data;
    let sum = 0;
    for (let i = 0; i < data.length; i += 4) sum = (sum * 31 + data[i] + 7 * data[i + 1] + 13 * data[i + 2] + data[i + 3]) % 1000003;
    return sum;
  };
  try {
    const end = Number(document.getElementById("scrub").max), first = drawn();
    expect("is ready", root.ready === "true");
    expect("begins at the start", time() === 0);
    document.getElementById("play").click();
    expect("plays", root.playing === "true");
    for (let i = 0; i < 100 && drawn() === first; i++) await wait(20);
    press(" ");
    const played = time();
    expect("moves on while it plays", played > 0);
    expect("draws something else", drawn() !== first);
    expect("pauses", root.playing === "false");
    await wait(300);
    expect("stands still", time() === played);
    const scrub = document.getElementById("scrub");
    scrub.value = end / 2;
    scrub.dispatchEvent(new Event("input"));
    expect("scrubs", Math.abs(time() - end / 2) <= end / 1000);
    const half = time(), middle = drawn();
    press("ArrowRight");
    expect("steps forward", time() > half);
    press("ArrowLeft");
    expect("steps back", Math.abs(time() - half) < 1e-9 * end && drawn() === middle);
    press("End");
    expect("goes to the end", time() === end);
    press("Home");
    expect("goes to the start", time() === 0 && drawn() === first);
    const speed = document.getElementById("speed"), before = speed.selectedIndex;
    press("ArrowUp");
    expect("gets faster", speed.selectedIndex === before + 1);
    press("+");
    expect("zooms", drawn() !== first);
    press("f");
    expect("fits again", drawn() === first);
    document.getElementById("traces").click();
    expect("hides the traces", drawn() !== first);
    document.getElementById("traces").click();
    const curves = document.getElementById("curves"), box = curves.getBoundingClientRect();
    curves.dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + box.width / 2, clientY: box.top + 5, buttons: 1 }));
    expect("scrubs in the curves", time() > 0.4 * end && time() < 0.6 * end);
    const which = document.getElementById("which");
    for (let i = 0; i < which.options.length; i++) {
      which.selectedIndex = i;
      which.dispatchEvent(new Event("change"));
    }
    press("]");
    expect("chooses curves by a key", which.selectedIndex === 0);
    press("t");
    expect("hides the traces by a key", document.getElementById("traces").getAttribute("aria-pressed") === "false");
    press("t");
    const said = document.getElementById("scene").getAttribute("aria-label");
    expect("says what it shows", said.includes("t = ") && run.bodies.every((body, b) => b > 7 || said.includes(body.name)));
    expect("says what the curves show", document.getElementById("curves").getAttribute("aria-label").includes(families[0].curves[0].name));
    expect("shows what the model is", document.getElementById("about").textContent.length > 10);
    expect("shows its parameters", document.getElementById("given").children.length === run.parameters.length);
    press("i");
    for (let i = 0; i < 100 && !root.image; i++) await wait(20);
    expect("saves a picture", Number((root.image || "").split(" ").pop()) > 5000);
    window.MediaRecorder = class { // in place of the browser's, which needs real time
      static isTypeSupported (type) { return type === "video/webm"; }
      constructor (stream) { this.tracks = stream.getVideoTracks().length; }
      start () { }
      stop () { this.ondataavailable({ data: new Blob(["x".repeat(this.tracks)]) }); this.onstop(); }
    };
    press("End");
    press("v");
    for (let i = 0; i < 100 && time() === end; i++) await wait(20);
    expect("records from the start", root.playing === "true" && time() < end / 2);
    press("v");
    expect("saves a video", root.playing === "false" && (root.video || "").endsWith(".webm 1"));
    press("Home");
    const labels = [[0.1, 0.1, "0.1"], [1234567.5, 0.5, "1.2345675\u00b710\u2076"], [1234568, 0.5, "1.234568\u00b710\u2076"],
      [-3e-7, 1e-7, "\u22123\u00b710\u207b\u2077"], [0, 1e9, "0"], [2e6, 1e6, "2\u00b710\u2076"], [12345.6, 0.2, "12345.6"], [0.5, 1e-7, "0.5"]];
    for (const [x, step, text] of labels) expect("labels " + text + " not " + number(x, step), number(x, step) === text);
    expect("has curves", which.options.length >= 6);
  } catch (e) { failures.push(String(e)); }
  const verdict = document.createElement("pre");
  verdict.id = "verdict";
  verdict.textContent = failures.length ? "fails: " + failures.join("; ") : "ok";
  document.body.append(verdict);
})();
