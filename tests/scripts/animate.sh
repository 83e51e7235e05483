#!/bin/sh
# Animations: complete HTML files; in a headless browser, if there is one, pages load, play and scrub as
# tests/scripts/animate.js expects, without a message on the console.  Reads PINWHEEL, BROWSER.

. "$(dirname "$0")/../support/report.sh"
here=$(cd "$(dirname "$0")" && pwd)

browser=$BROWSER
for b in chromium chromium-browser google-chrome; do
  [ -n "$browser" ] || ! command -v $b >/dev/null || browser=$b
done

# browse PAGE: the document after some seconds in $work/dom, messages in $work/console
browse () {
  timeout 120 "$browser" --headless --no-sandbox --disable-gpu --user-data-dir="$work/profile" --window-size=1000,760 \
    --virtual-time-budget=20000 --enable-logging=stderr --v=0 --dump-dom "file://$1" >"$work/dom" 2>"$work/messages"
  grep ':CONSOLE' "$work/messages" >"$work/console"
}

# A clock with frames 40 ms apart: a headless browser draws at irregular times.
clock='<script>{ let now = 0; performance.now = () => now;'
clock="$clock requestAnimationFrame = f => setTimeout(() => f(now += 40), 5); }</script>"

for model in ezyroller andrews-squeezer wheeled-snake pendulum car-tyres; do
  page=$work/$model.html
  "$pinwheel" run $model --animate "$page" >/dev/null 2>"$work/err"
  report "$model: the page is written" $?
  tail -n 1 "$page" | grep -q '</html>' && ! grep -Eq '(src|href)=|https?://|@import|\bNaN\b' "$page"
  report "$model: it is complete and needs no other file" $?
  [ -n "$browser" ] || { echo "# skipped: no browser was found to show it"; continue; }
  { sed "s|<head>|<head>$clock|" "$page" | sed '$d' | sed '$d'; echo '<script>'; cat "$here/animate.js"; echo '</script></body></html>'; } >"$work/use.html"
  browse "$work/use.html"
  grep -q '<pre id="verdict">ok</pre>' "$work/dom"
  good=$?
  report "$model: plays, scrubs, zooms" $good
  [ $good = 0 ] || grep -ao '<pre id="verdict">[^<]*' "$work/dom"
  [ ! -s "$work/console" ]
  report "$model: nothing on the console" $?
  cat "$work/console"
done

"$pinwheel" linearise chain --steady --animate "$work/modes.html" >/dev/null 2>"$work/err"
report 'a page of modes is written' $?
if [ -n "$browser" ]; then
  { sed '$d' "$work/modes.html" | sed '$d'; echo '<script>$("mode").selectedIndex = 2; $("mode").dispatchEvent(new Event("change")); play(true);'
    echo '</script></body></html>'; } >"$work/use.html"
  browse "$work/use.html"
  grep -q 'id="method">mode 5: 0 1/s' "$work/dom" && [ ! -s "$work/console" ]
  report 'another mode is chosen, nothing on the console' $?
fi

"$pinwheel" run ezyroller --animate "$work/x.mp4" >/dev/null 2>"$work/err"
[ $? = 2 ] && grep -q 'expected a name that ends in .html' "$work/err"
report 'a name without .html is an error' $?

exit $bad
