#!/bin/sh
# Interactive pages: in a headless browser, tests/scripts/page.js changes a parameter, the method and the tolerance, and
# the values that the page displays at the end are those of the program; page-checks.js checks the plot, the Worker, and the
# layout on phones.  Reads PINWHEEL, BROWSER.

. "$(dirname "$0")/../support/report.sh"
here=$(cd "$(dirname "$0")" && pwd)

browser=$BROWSER
for b in chromium chromium-browser google-chrome; do
  [ -n "$browser" ] || ! command -v $b >/dev/null || browser=$b
done

if "$pinwheel" page snakeboard -o "$work/snakeboard.html" 2>"$work/log"; then :; else
  grep -q 'built without the engine' "$work/log"
  report 'without the engine, the tools to install are named' $?
  echo '# skipped: there is no compiler for WebAssembly'
  exit $bad
fi

# The browser writes the document when it is loaded, that is, not before this frame is closed, with the verdict.
hold='<script>{ const hold = document.createElement("iframe"); hold.hidden = true; document.body.append(hold);
  hold.contentDocument.open();
  const timer = setInterval(() => { if (document.getElementById("verdict")) { clearInterval(timer); hold.contentDocument.close(); } }, 50); }</script>'

# show PAGE: its verdict in $work/verdict, messages in $work/console
show () {
  timeout 300 "$browser" --headless --no-sandbox --disable-gpu --user-data-dir="$work/profile" --window-size=1200,800 \
    --enable-logging=stderr --v=0 --dump-dom "file://$1" >"$work/dom" 2>"$work/messages"
  grep ':CONSOLE' "$work/messages" >"$work/console"
  sed -n '/<pre id="verdict">/,/<\/pre>/p' "$work/dom" | sed 's/.*<pre id="verdict">//; s/<[^>]*>//g' >"$work/verdict"
}

# browse PAGE SCRIPT...: shows it with these scripts at its end
browse () {
  file=$1
  shift
  { sed '$d' "$file" | sed '$d'; echo "$hold<script>"; cat "$@"; echo '</script></body></html>'; } >"$work/use.html"
  show "$work/use.html"
}

# same NAME: the positions in $work/verdict are those of $work/run.json, to 9 of the 10 digits displayed, and to 1e-10 in the table
same () {
  awk -F'[ ",:]+' '
    FNR == NR && /^    "/ && /{/ { body = $2 }
    FNR == NR && /^      "(x|y|phi)":/ { value[body "." $2] = $3; next }
    FNR == NR || NF == 0 { next }
    { split ($0, word, " "); n++
      if (!(word[1] in value)) { print; wrong = 1; next }
      d = word[2] - value[word[1]]
      e = word[3] - value[word[1]]; m = 1e-10 * (1 + value[word[1]] ^ 2)
      if (e > m || -e > m || d > 1e-9 * (1 + value[word[1]] ^ 2) || -d > 1e-9 * (1 + value[word[1]] ^ 2)) { print; wrong = 1 } }
    END { exit wrong || n < 3 }' "$work/run.json" "$work/verdict" >"$work/log"
  report "$1: displays the values of the program" $?
}

# try NAME MODEL PARAMETER VALUE T_END [OPTION...]: with page-checks.js if $checks is set, without what $forbidden matches
try () {
  name=$1 model=$2 parameter=$3 value=$4 t_end=$5
  shift 5
  "$pinwheel" page "$model" --t-end "$t_end" "$@" -o "$work/page.html" 2>"$work/log"
  report "$name: the page is written" $?
  # The engine in base 64 is left out: its letters may happen to be one of these words.
  ! sed -E 's/[A-Za-z0-9+/]{500,}=*//g' "$work/page.html" | grep -Eq '(src|href)=|https?://|@import|\bNaN\b' && tail -n 1 "$work/page.html" | grep -q '</html>'
  report "$name: it is complete and needs nothing else" $?
  [ -n "$browser" ] || { echo "# skipped: no browser was found to show it"; return; }
  sed -i "s|</head>|<script>const wanted = { name: \"$parameter\", value: $value };</script></head>|${forbidden:+; s/$forbidden//}" "$work/page.html"
  browse "$work/page.html" ${checks:+"$here/page-checks.js"} "$here/page.js"
  "$pinwheel" run "$model" --set "$parameter=$value" --t-end "$t_end" "$@" --method erk5+projection --rtol 1e-9 --json "$work/run.json" >/dev/null 2>&1
  same "$name"
  [ "$forbidden" ] || [ ! -s "$work/console" ]
  report "$name: nothing on the console" $?
  cat "$work/console"
}

checks= forbidden=
try snakeboard snakeboard swing 0.55 10
checks=yes try 'a model in C' models/vehicles/ezyroller.c a 0.7 10
forbidden='worker-src blob:;' try 'without Workers' models/vehicles/ezyroller.c a 0.7 10
try 'sliders whose ends are moved' slider-crank l1 1.2 1
try 'redundant constraints' models/linkages/redundant-parallelogram.c l 1.25 3
try 'contacts with friction' hopper mu 0.5 2
try 'a wheel that slides' drifting-car u0 11 5
try 'initial values of --start' pendulum m 2 1 --start bob.vy=2
try 'copies and included files' tests/models/arms.yaml n 3 1

cat >"$work/table.yaml" <<'Y'
pinwheel: 1
run: {method: "rk4+projection:every=2"}
bodies: [{name: sled, mass: 2, inertia: 0.5}]
elements:
  - {force: push, body: sled, fx: {table: {file: push.csv, columns: [t, fx]}}}
Y
printf 't,fx\n0,0\n1,3\n5,-1\n' >"$work/push.csv"

{
  printf 'pinwheel: 1\nparameters: [{name: m, value: 2}]\nbodies: [{name: sled, mass: m, inertia: 0.5}]\nelements:\n'
  for i in $(seq 70); do
    echo "  - {force: f$i, body: sled, fx: {table: {file: f$i.csv}}}"
    printf 't,fx\n0,1\n5,2\n' >"$work/f$i.csv"
  done
} >"$work/many.yaml"
try 'many tables' "$work/many.yaml" m 3 1

# Texts of a model are displayed as texts, and a page has no access to the network, neither by a script nor by an image.
cat >"$work/hostile.yaml" <<'Y'
pinwheel: 1
about: "</script><script>document.title = 'taken'</script> \" ' \\ \u2028 <img src=x onerror=alert(1)> -->"
parameters:
  - {name: k, value: 2, unit: "<b>m", about: "${k} `k` </script><!-- \u00e9\U0001F600"}
bodies: [{name: sled, mass: 2, inertia: 0.5, rate: {vx: k}}]
Y
cat >"$work/reach.js" <<'J'
(async () => {
  let refused = 0;
  document.addEventListener("securitypolicyviolation", () => refused++);
  for (let i = 0; i < 200 && !document.documentElement.dataset.ready; i++) await new Promise(done => setTimeout(done, 20));
  await fetch("https://example.org/").catch(() => 0);
  const image = new Image();
  image.src = "https://example.org/x.png";
  try { new WebSocket("wss://example.org/"); } catch (error) { /* counted */ }
  try { eval("document.title = 'taken'"); } catch (error) { /* counted */ }
  const code = "fetch('https://example.org/').then(() => postMessage('taken'), () => postMessage('refused'))";
  const worker = new Worker(URL.createObjectURL(new Blob([code])));
  const said = await new Promise(done => { worker.onmessage = e => done(e.data); });
  await new Promise(done => setTimeout(done, 300));
  const pre = document.createElement("pre");
  pre.id = "verdict";
  pre.textContent = [refused, document.title, document.querySelectorAll("img, b").length, $("about").textContent.slice(0, 9), said].join(" ");
  document.body.append(pre);
})();
J
"$pinwheel" page "$work/hostile.yaml" --t-end 1 -o "$work/page.html" 2>"$work/log" &&
  "$pinwheel" run "$work/hostile.yaml" --t-end 1 --animate "$work/animation.html" >/dev/null 2>>"$work/log"
report 'pages of a model with hostile texts are written' $?
for page in page animation; do
  [ -n "$browser" ] || break
  browse "$work/$page.html" "$work/reach.js"
  grep -q '4 hostile . Pinwheel 0 &lt;/script.* refused' "$work/verdict"
  report "$page: hostile texts are texts; fetch, image, socket and eval are refused" $?
  cat "$work/verdict"
done

# On phones, in a frame without an address, as in notebooks; a browser's window has 500 pixels at least.
"$pinwheel" page chaplygin-sleigh -o "$work/page.html" 2>"$work/log" &&
  "$pinwheel" run chaplygin-sleigh --animate "$work/animation.html" >/dev/null 2>>"$work/log"
report 'pages for phones are written' $?
for kind in page animation; do
  [ -n "$browser" ] || break
  { sed '$d' "$work/$kind.html" | sed '$d'; echo '<script>'; cat "$here/page-checks.js"
    cat <<'J'; echo '</script></body></html>'; } | sed 's/&/\&amp;/g; s/"/\&quot;/g' >"$work/phone.text"
(async () => {
  const root = document.documentElement.dataset, done = () => root.ready && (!window.start_page || root.simulated === "yes");
  for (let i = 0; i < 500 && !done(); i++) await later(20);
  const pre = parent.document.createElement("pre");
  pre.id = "verdict";
  pre.textContent = done() ? await checkPhone() : "not ready: " + $("reason").textContent;
  parent.document.body.append(pre);
})();
J
  { echo '<!DOCTYPE html><html><body>'; printf '<iframe width="390" height="780" srcdoc="'; cat "$work/phone.text"
    echo "\"></iframe>$hold</body></html>"; } >"$work/phone.html"
  show "$work/phone.html"
  cp "$work/verdict" "$work/log"
  grep -Eq '^390 [1-9][0-9]* good' "$work/verdict" && [ ! -s "$work/console" ]
  report "$kind: on a phone, picture and sliders are visible together, sliders are 40 px high, no help for keyboards" $?
done

"$pinwheel" page "$work/table.yaml" --t-end 5 -o "$work/table.html" 2>"$work/log"
[ $? = 0 ] && grep -q '"push.csv"' "$work/table.html"
report 'the page contains the tables of its model' $?
grep -q '"method": "erk8+projection"' "$work/table.html"
report 'a default method of a model that pages do not have is replaced' $?

grep -q '"method": "erk8+projection"' "$work/page.html"
report 'a page begins with a method that chooses its steps, although the model has another one' $?
"$pinwheel" page pendulum -o "$work/page.html" --method rk4+nullspace && grep -q '"method": "rk4+nullspace"' "$work/page.html" &&
  "$pinwheel" page pendulum -o "$work/page.html" --step 0.01 && grep -q '"method": "rk4+projection"' "$work/page.html"
report 'but with the method of --method, and that of the model for --step' $?

# The name of a model suffices, in any folder, if the source lies next to the plug-in.
for model in $("$pinwheel" list models | sed -n 's|.*models/\([a-z0-9-]*\)\.so$|\1|p'); do
  (cd "$work" && "$pinwheel" page "$model" -o here.html) >"$work/log" 2>&1 || echo "$model: $(cat "$work/log")"
done >"$work/failures"
mv "$work/failures" "$work/log"
[ ! -s "$work/log" ] && [ -s "$work/here.html" ]
report 'pages of all compiled models of the gallery by their names, from another folder' $?
mkdir "$work/alone" && cp "$(dirname "$pinwheel")/models/ezyroller.so" "$work/alone/alone.so"
for model in alone "$work/alone/alone.so" "$(dirname "$pinwheel")/models/ezyroller.so"; do
  PINWHEEL_MODELS=$work/alone "$pinwheel" page "$model" -o "$work/x.html" 2>"$work/log"
  [ $? = 2 ] && grep -q '\.so: .* name its source, a .c file; .* installed in share/doc/pinwheel/examples' "$work/log" && [ ! -e "$work/x.html" ]
  report "a compiled model without its source, or one by its path, is refused: ${model##*/}" $?
done
"$pinwheel" page snakeboard --method ida+ggl -o "$work/x.html" 2>"$work/log"
[ $? = 2 ] && grep -q 'pages have rk4, erk5, erk8, radau' "$work/log" && [ ! -e "$work/x.html" ]
report 'a method that pages do not have is refused' $?
sed 's/trim: 0.1/trom: 0.1/' models/vehicles/snakeboard.yaml >"$work/preset.yaml"
"$pinwheel" page "$work/preset.yaml" -o "$work/x.html" 2>"$work/log"
[ $? = 2 ] && grep -q 'preset "drive it": no setting or parameter "trom"; did you mean "trim"' "$work/log" && [ ! -e "$work/x.html" ]
report 'an unknown name in a preset is refused, with the nearest one' $?
"$pinwheel" page snakeboard -o "$work/x.pdf" 2>"$work/log"
[ $? = 2 ] && grep -q 'ends in .html' "$work/log"
report 'a name without .html is an error' $?

exit $bad
