#!/bin/sh
# Writes an interactive page for every model of the gallery, and an index of them with pictures.
#
#   gallery.sh PROGRAM MODELS FIGURES DIRECTORY
program=$1 models=$2 figures=$3 site=$4
set -e
mkdir -p "$site"
escape () { sed 's/&/\&amp;/g; s/</\&lt;/g; s/>/\&gt;/g'; }
{
  cat <<'END'
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src 'self' file:">
<title>Pinwheel: gallery</title>
<style>
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
ul { display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: 1rem; list-style: none; padding: 0; }
li { border: 1px solid #8886; border-radius: 8px; overflow: hidden; }
li a { display: block; padding: 0 .8rem .8rem; color: inherit; text-decoration: none; height: 100%; }
li a:hover strong, li a:focus-visible strong { text-decoration: underline; }
img { width: calc(100% + 1.6rem); height: 11rem; margin: 0 -.8rem .5rem; object-fit: contain; background: #fff; display: block; }
strong, span { display: block; }
span::first-letter { text-transform: uppercase; }
</style>
</head>
<body>
<h1>Pinwheel: gallery</h1>
<p>Each page simulates a vehicle or a linkage in the browser: move a slider and see the motion, its error and its cost change.</p>
<ul>
END
  find "$models" -name '*.c' -o -name '*.yaml' | sed 's,.*/\(.*\)\..*,\1 &,' | LC_ALL=C sort | while read -r name path; do
    "$program" page "$path" -o "$site/$name.html" >&2
    about=$("$program" show "$path" | head -n 1 | escape)
    picture=$figures/gallery-$name.png
    [ -f "$picture" ] || picture=$figures/$name-mechanism.png
    cp "$picture" "$site/$name.png"
    echo "<li><a href=\"$name.html\"><img src=\"$name.png\" alt=\"\" loading=\"lazy\"><strong>$name</strong><span>${about#*: }</span></a></li>"
  done
  echo '</ul>'
  echo '</body>'
  echo '</html>'
} >"$site/index.html"
echo "gallery: $site/index.html" >&2
