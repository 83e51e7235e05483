# include look.gp
# ---- Curves of bodies or wheels, a block of the file `data` each; more than 12 are coloured by number ----
# Above: t_end [s], data, what ('body' or 'wheel'), curves (their number), label[i] unless there are more than 12,
# numbers (of all bodies or wheels), number_column of the data, markers (a list of the blocks, from 0, of markers).

numbered = curves > 12
label_length = 0
if (!numbered) {
  eval lines(curves)
  do for [i = 1:curves] { label_length = max(label_length, strlen(short(label[i]))) }
}
legend_top = top
items = numbered ? 0 : curves
per_row = columns(label_length)
if (numbered) { right = 46 } else { top = top + rows(items, per_row) }
# The legend; bar: 1 with the scale of colours, if there are more than 12 curves.
legend(bar) = !numbered ? key(legend_top, per_row) : \
  sprintf("unset key; set cbrange [1:%d]; set cblabel 'number of the %s'; ", numbers, what). \
  (bar ? 'set colorbox user origin graph 1.02,graph 0 size graph 0.02,graph 1' : 'unset colorbox')
# Draws column y in units of 10^n against column x.
draw(x, y, n, titled) = numbered ? \
  sprintf('plot data using %d:($%d/1e%d):%d with lines lw 0.7 dt 1 lc palette', x, y, n, number_column) : \
  sprintf('plot for [i = 1:curves] data index i - 1 using %d:($%d/1e%d) with lines lt i ', x, y, n). \
  (titled ? 'title short(label[i])' : 'notitle')
# include plane.gp

# ---- Paths of wheels and markers, or of the centres of mass ----

title = 'paths of the '.(what eq 'body' ? 'centres of mass' : words(markers) == 0 ? 'wheels' : \
  words(markers) < curves ? 'wheels and markers' : 'markers')
# A path that is no longer than a point is drawn as one.
points = ''
do for [i = 1:curves] {
  stats data index i - 1 using 2 name 'x' nooutput
  stats data index i - 1 using 3 name 'y' nooutput
  if (max(x_max - x_min, y_max - y_min) < 5e-3*(x1[1] - x0[1])) {
    points = points.sprintf(', data index %d every ::::0 using 2:3 with points lc rgb "%s" pt 7 ps 0.8 notitle', i - 1, \
                            numbered ? '#777777' : colour(i))
  }
}
do for [form in forms] {
  eval page(form)
  eval axes
  do for [i = 1:panels] {
    eval legend(i == panels)
    eval place(i)
    eval 'plot '.below.draw(2, 3, 0, i == 1)[6:*].points
  }
  eval finish
}
