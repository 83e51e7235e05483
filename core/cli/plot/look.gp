
# ---- Look ----

set encoding utf8
set border lw 0.8 lc rgb '#404040'
set tics nomirror out scale 0.6
set grid lt 1 lw 0.6 lc rgb '#dddddd'
set ylabel offset 0.7,0
set offsets 0,0,graph 0.04,graph 0.04
set xzeroaxis lt 1 lw 0.8 lc rgb '#999999'
# Dark blue, red, yellow, grey: distinct for colour-blind readers and in greyscale; dashes help.
do for [i = 0:11] {
  eval sprintf('set linetype %d lw 1.8 dt %s lc rgb "%s"', i + 1, \
               word('1 (14,4) (5,3) (16,4,4,4)', (i + i/4) % 4 + 1), \
               word('#004488 #bb5566 #cc9911 #888888', i % 4 + 1))
}
# From dark to light, in greyscale as in colour; the lightest end is still visible on paper.
set palette defined (0 '#0d0887', 1 '#6a00a8', 2 '#b12a90', 3 '#e16462', 4 '#f6a13c')

# ---- Page: sizes in pixels, panels measured from the upper left corner ----

width = 900.0
left = 96.0
right = 28.0
top = 42.0
bottom = 66.0

min(a, b) = a < b ? a : b
max(a, b) = a > b ? a : b
page(form) = sprintf(form eq 'svg' ? \
    "set terminal svg size %d,%d noenhanced font 'DejaVu Sans,Helvetica,sans-serif,13' background rgb 'white'" : \
    "set terminal pngcairo size %d,%d noenhanced font 'Sans,10.5' background rgb 'white'", width, height). \
  sprintf("; set output '%s.%s'; set multiplot title short(model).': '.title.incomplete font ',%d'", name, form, \
          form eq 'svg' ? 16 : 13)
panel(x0, x1, y0, y1) = sprintf('set lmargin at screen %.6f; set rmargin at screen %.6f; ', x0/width, x1/width). \
  sprintf('set tmargin at screen %.6f; set bmargin at screen %.6f', 1 - y0/height, 1 - y1/height)
key(y, columns) = sprintf('set key at screen 0.5,screen %.6f center top horizontal maxcols %d', 1 - y/height, columns)
short(s) = strlen(s) > 24 ? s[1:24].'…' : s
