
# ---- Look of all figures ----
# A figure is a template NAME.gp; a line "# include OTHER.gp" stands for the contents of another one.  Pinwheel writes
# variables above the template, which lists them after "Above:"; for all figures name (of the figure), model (its name),
# incomplete ('', or how far the run got), about (the title) and width [pt].  A template computes `height` and draws the
# figure in each of the forms: eval page(form), panels, eval finish.
#
# Lengths are in points.  panel(x0, x1, y0, y1) places a plot, measured from the upper left corner of the page.
# key(y, columns) places the legend of the next plot; n entries in rows of `columns` take the height rows(n, columns).
# Between begin_legend and end_legend a plot draws a legend alone, in a panel of its own.
#
# Text of the user (labels, names) is plain, that of templates enhanced: 'v_x [m/s]', '10^{%T}'.  Dash and width
# distinguish line types without colour; earlier ones are wider, so that they stay visible below later ones.

set encoding utf8
set minussign
set border lw 0.5 lc rgb '#404040'
set tics nomirror out scale 0.5
grid = "set grid back lt 1 lw 0.4 lc rgb '#dddddd'; "
eval grid
set offsets 0,0,graph 0.04,graph 0.04
set xzeroaxis lt 1 lw 0.5 lc rgb '#999999'
# Distinct for colour-blind readers; neighbours differ in greyscale as well.
colours = '#004488 #cc6677 #c49a00 #117755 #8844aa #777777 #44aadd #884411'
dashes = '1 (10,4) (4,3) (14,3,3,3)'
colour(i) = word(colours, (i - 1) % 8 + 1)
min(a, b) = a < b ? a : b
max(a, b) = a > b ? a : b
thickness(i, n) = n < 2 ? 1.1 : 1.7 - 0.8*(i - 1)/(n - 1)
# Sets line types 1 to n.
lines(n) = 'do for [i = 1:'.sprintf('%d', n).'] { eval sprintf("set linetype %d lw %.2f dt %s lc rgb ''%s''", i, '. \
  'thickness(i, '.sprintf('%d', n).'), word(dashes, (i - 1) % 4 + 1), colour(i)) }'
eval lines(4)
# From dark to light, in greyscale as in colour; the lightest end is still visible on paper.
set palette defined (0 '#0d0887', 1 '#6a00a8', 2 '#b12a90', 3 '#e16462', 4 '#f6a13c')

# ---- Page ----

forms = 'svg png pdf'
letter = 4.8 # width of a letter in a legend
left = 44.0
right = 12.0
bottom = 32.0
narrow = width < 300 # one column of a page with two

# The title begins with a capital, and has lines of at most `letters` characters, broken between words where possible; the
# special characters of enhanced text are escaped.
heading = ''
remains = about
letters = int((width - 16)/5.2)
while (strlen(remains)) {
  cut = min(letters, strlen(remains))
  if (cut < strlen(remains)) {
    do for [i = 2:letters + 1] { if (remains[i:i] eq ' ') { cut = i - 1 } }
  }
  do for [i = 1:cut] {
    c = remains[i:i]
    small = i == 1 && !strlen(heading) ? strstrt('abcdefghijklmnopqrstuvwxyz', c) : 0
    heading = heading.(strstrt('\_^{}@&~', c) ? '\' : '').(small ? 'ABCDEFGHIJKLMNOPQRSTUVWXYZ'[small:small] : c)
  }
  remains = remains[cut + (remains[cut + 1:cut + 1] eq ' ' ? 2 : 1):*]
  if (strlen(remains)) { heading = heading."}\n{/*1.13 " }
}
top = 30.0 # end of the title; templates add the legend
do for [i = 1:strlen(heading)] { if (heading[i:i] eq "\n") { top = top + 11 } }

# Terminals differ in the place of a legend: lift [pt] moves it up, pitch is the distance of its lines.
terminal(form) = form eq 'svg' ? "svg size %.2f,%.2f enhanced font 'DejaVu Sans,Helvetica,sans-serif,10' ". \
    "linewidth 1.3333 background rgb 'white'; set pointsize 0.6; lift = 2; pitch = 0.82; ". \
    "set xlabel offset 0,0.6; set ylabel offset 0.8,0" : \
  form eq 'png' ? "pngcairo size %.2f,%.2f enhanced font 'DejaVu Sans,7.5' fontscale 1.5625 linewidth 2.0833 ". \
    "pointscale 2.0833 background rgb 'white'; set pointsize 0.5; lift = 5; pitch = 1; ". \
    "set xlabel offset 0,0; set ylabel offset 0,0" : \
    "pdfcairo size %.6f,%.6f enhanced font 'DejaVu Sans,7.5' fontscale 0.75 linewidth 2; set pointsize 0.25; ". \
    "lift = 5; pitch = 1; set xlabel offset 0,0; set ylabel offset 0,0"
page(form) = sprintf('set terminal '.terminal(form), width*scale(form), height*scale(form)). \
  sprintf("; set output '%s.%s'; ", name, form). \
  'caption = "{/*1.13 ".heading."}\n".title.incomplete; set multiplot title caption'
finish = 'unset multiplot; unset output'
scale(form) = form eq 'svg' ? 96/72.0 : form eq 'png' ? 150/72.0 : 1/72.0 # units of a terminal in a point
panel(x0, x1, y0, y1) = sprintf('set lmargin at screen %.6f; set rmargin at screen %.6f; ', x0/width, x1/width). \
  sprintf('set tmargin at screen %.6f; set bmargin at screen %.6f', 1 - y0/height, 1 - y1/height)
key(y, columns) = sprintf('set key noenhanced at screen 0.5,screen %.6f center top ', 1 - (y - lift)/height). \
  sprintf('horizontal maxcols %d samplen 3 spacing %g', columns, pitch)
# Panels in two columns, if there is room, with a gap between them.
two_columns = "panel_columns = narrow ? 1 : min(panels, 2); ". \
  "panel_rows = (panels + panel_columns - 1)/panel_columns; ". \
  "panel_width = (width - left - right + gap)/panel_columns - gap"
bare_x = "set format x ''; set xlabel ''" # the axis of a panel above another one
# A panel of the legend alone, at legend_top.
begin_legend(columns) = key(legend_top, columns)."; set tics scale 0; set format ''; set border 0; unset grid; ". \
  "unset xzeroaxis; set xlabel ''; set ylabel ''; set xrange [1:10]; set yrange [1:10]; ". \
  panel(left, width - right, legend_top - 1, top - 1)
end_legend = 'unset key; set tics scale 0.5; set border 31; set autoscale; '.grid
# Entries in a row of a legend: no more than gnuplot would set; height of n entries.
columns(label_length) = max(1, int((width - left - right)/(32 + letter*label_length)))
rows(n, columns) = 3 + 9.6*((n + columns - 1)/columns)
short(s) = strlen(s) > 24 ? s[1:24].'…' : s

# The exponent of a power of ten in the label of an axis, instead of long numbers at its tics; 0: none.
power(lo, hi) = (largest = max(abs(lo), abs(hi)), exponent = largest > 0 ? int(floor(log10(largest))) : 0, \
                 exponent > 3 || exponent < -2 ? exponent : 0)
# The range of axis z of values from lo to hi in units of 10^n: gnuplot chooses it unless they are nearly constant.
range(z, lo, hi, n) = (largest = max(abs(lo), abs(hi)), edge = largest > 0 ? 0.1*largest : 1, \
  hi - lo > 1e-6*largest ? sprintf('set %srange [*:*]', z) : \
  sprintf('set %srange [%.15g:%.15g]', z, (lo - edge)/10.0**n, (hi + edge)/10.0**n))
# The left margin for the label and tics of such a y axis.
margin_of(lo, hi, n) = (largest = max(abs(lo), abs(hi))/10.0**n, extent = abs(hi - lo)/10.0**n, \
  extent = max(extent, largest*(extent > 1e-6*largest ? 1e-6 : 0.2)), \
  whole = largest > 0 ? int(floor(log10(largest))) : 0, step = extent > 0 ? int(floor(log10(extent/5))) : 0, \
  digits = abs(whole) > 4 ? max(whole - step, 0) + 6 : max(whole, 0) + 1 + (step < 0 ? 1 - step : 0), \
  max(left, 22 + 5.5*(digits + (lo < 0))))
axis(label, unit, n) = label.' ['.(n ? sprintf('10^{%d} ', n) : '').unit.']'
