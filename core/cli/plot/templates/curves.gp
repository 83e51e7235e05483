
# ---- A family of curves: a block of the data and a label each; more than 12 are coloured by number ----

numbered = curves > 12
longest = 0
if (!numbered) {
  eval lines(curves)
  do for [i = 1:curves] { longest = max(longest, strlen(short(label[i]))) }
}
above = top # of the legend
items = numbered ? 0 : curves
per_row = columns(longest)
if (numbered) { right = 46 } else { top = top + rows(items, per_row) }
legend(bar) = !numbered ? key(above, per_row) : \
  sprintf("unset key; set cbrange [1:%d]; set cblabel 'number of the %s'; ", numbers, what). \
  (bar ? 'set colorbox user origin graph 1.02,graph 0 size graph 0.02,graph 1' : 'unset colorbox')
draw(x, y, n, titled) = numbered ? \
  sprintf('plot data using %d:($%d/1e%d):%d with lines lw 0.7 dt 1 lc palette', x, y, n, last) : \
  sprintf('plot for [i = 1:curves] data index i - 1 using %d:($%d/1e%d) with lines lt i ', x, y, n). \
  (titled ? 'title short(label[i])' : 'notitle')

# gnuplot chooses the range unless the values are nearly constant.
size(lo, hi) = max(abs(lo), abs(hi))
yrange(lo, hi, n) = hi - lo > 1e-6*size(lo, hi) ? 'set yrange [*:*]' : \
  sprintf('set yrange [%.9g:%.9g]', (lo - (size(lo, hi) > 0 ? 0.1*size(lo, hi) : 1))/10.0**n, \
          (hi + (size(lo, hi) > 0 ? 0.1*size(lo, hi) : 1))/10.0**n)
