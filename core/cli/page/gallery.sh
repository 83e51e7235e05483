#!/bin/sh
# Writes an interactive page for every model of the gallery, and an index of them.
#
#   gallery.sh PROGRAM MODELS DIRECTORY
program=$1 models=$2 site=$3
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
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<title>Pinwheel: gallery</title>
<style>
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; max-width: 44rem; margin: 2rem auto; padding: 0 1rem; }
li { margin: .4rem 0; }
</style>
</head>
<body>
<h1>Pinwheel: gallery</h1>
<p>Each page simulates a vehicle or a linkage in the browser: move a slider and see the motion, its error and its cost change.</p>
<ul>
END
  (cd "$models" && LC_ALL=C ls *.c *.yaml) | while read -r file; do
    name=${file%.*} path=$models/$file
    "$program" page "$path" -o "$site/$name.html" >&2
    about=$("$program" show "$path" | head -n 1 | escape)
    echo "<li><a href=\"$name.html\">$name</a>: ${about#*: }</li>"
  done
  echo '</ul>'
  echo '</body>'
  echo '</html>'
} >"$site/index.html"
echo "gallery: $site/index.html" >&2
