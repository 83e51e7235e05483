
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
