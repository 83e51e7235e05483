# include look.gp

# ---- Panels of curves ----
# Above: title, panels (their number).  Of panel k: x_k, y_k (labels of its axes), scale_k (label of a scale of
# colours; '': none), form_k (words: half, beside another one if there is room; below, with the x axis of the panel
# above it; logx, logy), aspect_k (height / width; 0: low and wide), range_k (x0 x1 y0 y1 z0 z1), curves_k (numbers of
# the first and the last one).  Of curve c: style_c, label_c ('': not in the legend), block_c (of the data; -1: it has
# no points), points_c (their number).  Columns of the data: x, y, z; of cells the ends in x and y after them.

data = name.'.dat'
get(what, k) = value(sprintf('%s_%d', what, k))
limit(k, i) = word(get('range', k), i) + 0.0
is(what, k) = k <= panels && strstrt(get('form', k), what) > 0
joined(k) = k > 1 && is('below', k)
# How a curve is drawn, the i-th one of its panel.  A method has a colour for its integrator with options, a dash for
# its stabilisation, and a mark of its own.
line(width, dash, colour) = sprintf("lw %g dt %s lc rgb '#%s'", width, dash, colour)
spot(type, size, colour) = sprintf("points pt %d ps %g lw 0.8 lc rgb '#%s'", type, size, colour)
look(s, i) = \
  s eq 'line' ? sprintf('lines lt %d', i) : \
  s eq 'method' ? sprintf('linespoints ls %d', i) : \
  s eq 'stable' || s eq 'model' ? 'lines '.line(1.1, '1', '004488') : \
  s eq 'unstable' ? 'lines '.line(1.1, '(8,5)', 'cc6677') : \
  s eq 'thin' ? 'lines '.line(0.8, '1', '777777') : \
  s eq 'change' ? 'vectors nohead '.line(0.7, '(2,4)', '000000') : \
  s eq 'fold' ? 'vectors nohead '.line(0.7, '(10,4,2,4)', 'c49a00') : \
  s eq 'event' ? sprintf("vectors nohead lw 0.5 dt %s lc rgb '%s'", word(dashes, i % 4 + 1), colour(9 - i%8)) : \
  s eq 'cells' ? 'boxxyerror lc palette fs solid border' : \
  s eq 'graded' ? 'lines lw 0.7 dt 1 lc palette' : \
  s eq 'band' ? "boxxyerror fc rgb '#e8e8e8' fs solid noborder" : \
  s eq 'bars' ? "yerrorbars pt 7 ps 0.35 lw 0.6 lc rgb '#888888'" : \
  s eq 'data' ? spot(7, 0.35, '888888') : \
  s eq 'feasible' ? spot(7, 0.4, '004488') : \
  s eq 'infeasible' ? spot(7, 0.4, 'bbbbbb') : \
  s eq 'best' ? spot(6, 1.6, 'cc6677') : \
  s eq 'dots' ? spot(7, 0.6, 'cc6677') : \
  s eq 'rings' ? spot(6, 0.9, '777777') : \
  s eq 'numbered' ? 'points pt 7 ps 0.5 lc variable' : 'points pt 7 ps 0.35 lc palette'
array tens[max(1, panels)]
do for [k = 1:panels] { tens[k] = is('logy', k) || get('aspect', k) > 0 ? 0 : power(limit(k, 3), limit(k, 4)) }
shown_column(k, c) = tens[k] ? sprintf('($%d/1e%d)', c, tens[k]) : sprintf('%d', c)
raised(n) = (number = sprintf('%d', n), shown = '', sum [j = 1:strlen(number)] (shown = shown. \
  (number[j:j] eq '-' ? '⁻' : word('⁰ ¹ ² ³ ⁴ ⁵ ⁶ ⁷ ⁸ ⁹', number[j:j] + 1)), 0), shown)
powered(label, n) = n == 0 ? label : (at = strstrt(label, '['), power_of_ten = '10'.raised(n), \
  at ? label[1:at].power_of_ten.' '.label[at + 1:*] : label.' ['.power_of_ten.']')
across(s) = s eq 'change' || s eq 'fold' || s eq 'event'
shown_limit(k, i) = limit(k, i)/10.0**tens[k]
part(s, k) = across(s) ? sprintf('1:(%g):(0):(%g)', shown_limit(k, 3), shown_limit(k, 4) - shown_limit(k, 3)) : \
  s eq 'band' ? sprintf('(%g):2:(%g):(%g):(%g):2', limit(k, 1), limit(k, 1), limit(k, 2), limit(k, 3)) : \
  s eq 'cells' ? '1:'.shown_column(k, 2).':4:5:'.shown_column(k, 6).':'.shown_column(k, 7).':3' : \
  s eq 'bars' ? '1:'.shown_column(k, 2).':'.shown_column(k, 3) : \
  '1:'.shown_column(k, 2).(s eq 'numbered' || s eq 'scale' || s eq 'graded' ? ':3' : '')
# A label of a method without its stabilisation.
without(s) = (plus = strstrt(s, '+'), colon = strstrt(s, ':'), \
  plus == 0 ? s : s[1:plus - 1].(colon > plus ? s[colon:*] : ''))
known = 'projection none baumgarte ggl nullspace index2 si1 index3'
dashing = '1 (2,3) (10,4) (10,4,3,4) (20,6) (10,3,3,3,3,3) (16,4,16,4,3,4) (5,5) (14,3,2,3,2,3,2,3)'
dash(s) = (place = 9, sum [k = 1:8] (word(known, k) eq s ? (place = k) : 0), word(dashing, place))
# Point types, filled and open in turn, so that neighbours differ most.
marks = '7 4 9 12 5 6 13 8 11 10 15 14 2 1 3'

# ---- Curves ----

array plots[panels]   # the commands that draw panels
array legends[panels] # those that draw legends above them
array legend[panels]  # their labels, each followed by a newline
array entries[panels] # their number
array per_row[panels]
do for [k = 1:panels] {
  first = word(get('curves', k), 1) + 0
  curves = word(get('curves', k), 2) - first + 1
  array colour_of[curves]
  methods = 0
  used = 0 # colours
  solid = 0 # curves of style `line`
  marked = 0 # of style `event`
  longest = 8
  plots[k] = 'plot NaN notitle'
  legends[k] = 'plot NaN notitle'
  legend[k] = ''
  entries[k] = 0
  do for [i = 1:curves] {
    c = first + i - 1
    s = word(get('style', c), 1)
    label = get('label', c)
    solid = solid + (s eq 'line')
    marked = marked + (s eq 'event')
    n = s eq 'line' ? solid : s eq 'event' ? marked : i
    if (s eq 'method') {
      stabilisation = word(get('style', c), 2)
      colour_of[i] = 0
      do for [j = 1:i - 1] {
        if (without(get('label', first + j - 1)) eq without(label)) { colour_of[i] = colour_of[j] }
      }
      if (colour_of[i] == 0) {
        used = used + 1
        colour_of[i] = used
      }
      m = methods
      methods = methods + 1
      eval sprintf("set style line %d lw %.2f dt %s lc rgb '%s' pt %s", i, 0.7*thickness(methods, curves), \
        stabilisation eq '' ? word('1 (10,4) (10,4,3,4) (4,4)', m % 4 + 1) : dash(stabilisation), \
        colour(colour_of[i]), word(marks, m % 15 + 1))
    }
    if (get('block', c) >= 0) {
      plots[k] = plots[k].sprintf(', data index %d using %s with %s notitle', get('block', c), part(s, k), \
        s eq 'method' ? sprintf('lines ls %d', i) : look(s, n))
    }
    if (get('block', c) >= 0 && s eq 'method') { # 10 to 19 marks, or all, at other places than those of other methods
      step = max(1, get('points', c)/10)
      plots[k] = plots[k].sprintf(', data index %d every %d::%d with points ls %d notitle', get('block', c), \
        step < 2 ? 1 : step, step < 2 ? 0 : int(step*(i - 1.0)/curves), i)
    }
    if (strlen(label)) {
      entries[k] = entries[k] + 1
      longest = max(longest, strlen(short(label)))
      legend[k] = legend[k].label."\n"
      legends[k] = legends[k].sprintf(", keyentry with %s title short(get('label', %d))", look(s, n), c)
    }
  }
  if (solid) { eval lines(max(4, solid)) }
  # A legend is above the panels that share an x axis, and is not repeated.
  if (joined(k)) { entries[k] = 0 }
  do for [j = 1:k - 1] { if (legend[j] eq legend[k]) { entries[k] = 0 } }
  per_row[k] = columns(longest)
}

# ---- Places ----

array x0[panels] # [pt]
array x1[panels]
array y0[panels]
array y1[panels]
do for [k = 1:panels] { if (!is('logy', k)) { left = margin_of(limit(k, 3), limit(k, 4), tens[k]) } }
full = width - left - right
beside = 0 # 1: there is room on the right of the last panel
do for [k = 1:panels] {
  halved = !narrow && is('half', k)
  span = halved ? 0.5*(full - left - 6) : full
  if (joined(k)) { y = y1[k - 1] + 10 } \
  else {
    x = halved && beside ? left + span + left + 6 : left
    if (x == left) { begin = top } # of the row
    if (entries[k]) { begin = begin + rows(entries[k], per_row[k]) }
    y = begin
    beside = halved && !beside
  }
  high = get('aspect', k) > 0 ? get('aspect', k)*span : narrow ? 90.0 : 112.0
  wide = span - (strlen(get('scale', k)) && get('aspect', k) == 0 ? 62 : 0)
  if (high > 230) {
    wide = wide*230/high
    high = 230.0
  }
  x0[k] = x + (get('aspect', k) > 0 ? 0.5*(span - wide) : 0)
  x1[k] = x0[k] + wide
  y0[k] = y
  y1[k] = y + high
  top = max(top, y1[k] + bottom + 8)
}
height = top - 8

# ---- Drawing ----

unset offsets
do for [form in forms] {
  eval page(form)
  do for [k = 1:panels] {
    unset logscale
    if (entries[k]) {
      top = y0[k]
      legend_top = top - rows(entries[k], per_row[k])
      eval begin_legend(per_row[k])
      eval legends[k]
      eval end_legend
    }
    set xzeroaxis lt 1 lw 0.5 lc rgb '#999999'
    set yzeroaxis lt 1 lw 0.5 lc rgb '#999999'
    if (is('logx', k)) { set logscale x; unset yzeroaxis }
    if (is('logy', k)) { set logscale y; unset xzeroaxis }
    set format x (joined(k + 1) ? '' : is('logx', k) && limit(k, 2) > 1e4*limit(k, 1) ? '10^{%T}' : '%g')
    set format y (is('logy', k) ? '10^{%T}' : '%g')
    set format cb '%g'
    set xlabel (joined(k + 1) ? '' : get('x', k)) noenhanced
    set ylabel powered(get('y', k), tens[k]) noenhanced
    set cblabel get('scale', k) offset 1.5,0 noenhanced
    set xrange [limit(k, 1):limit(k, 2)]
    set yrange [shown_limit(k, 3):shown_limit(k, 4)]
    set cbrange [limit(k, 5):limit(k, 6)]
    eval panel(x0[k], x1[k], y0[k], y1[k])
    eval plots[k]
  }
  eval finish
}
