# include look.gp
# include methods.gp

# ---- Work-precision diagram: error against CPU time and against evaluations, a line for each method ----
# Above: uncertainty (of the reference), size_of_motion (largest coordinate).

data = 'work-precision.dat'
angles = name eq 'work-precision-angles'
title = 'work-precision diagram'.(angles ? ' of angles' : '')
label_of_error = angles ? 'largest error of an angle [rad]' : 'largest error of a coordinate [m]'
column_of_error = angles ? 5 : 4
panel_width = narrow ? width - left - right : 0.5*(width - left - 14 - right)
panel_height = narrow ? 0.85*panel_width : 1.05*panel_width
height = top + panel_height + (narrow ? panel_height + 36 : 0) + bottom
stats data using 2 name 'cpu' nooutput
stats data using 3 name 'rhs' nooutput
stats data using (column(column_of_error) > 0 ? column(column_of_error) : NaN) name 'error' nooutput
largest = min(3*error_max, max(10*error_min, size_of_motion)) # of the axis: larger errors mean nothing
set logscale xy
set format '10^{%T}'
unset offsets
unset xzeroaxis
do for [form in forms] {
  eval page(form)
  eval begin_legend(per_row)
  plot for [i = 1:methods] NaN with linespoints ls i title label[i]
  eval end_legend
  set ylabel label_of_error
  set format '10^{%T}'
  set yrange [error_min/4:largest]
  if (uncertainty > error_min/4) {
    set object 1 rectangle from graph 0,graph 0 to graph 1,first uncertainty behind fc rgb '#e8e8e8' fs noborder
    set label 1 'below the uncertainty of the reference' at graph 0.02,first uncertainty offset 0,-0.6 \
      textcolor rgb '#555555'
  }
  set xlabel 'CPU time [s]'
  set xrange [cpu_min/1.6:cpu_max*1.6]
  eval panel(left, left + panel_width, top, top + panel_height)
  plot for [i = 1:methods] data index i - 1 using 2:column_of_error with linespoints ls i notitle
  if (!narrow) {
    set ylabel ''
    set format y ''
  }
  unset label 1
  set xlabel 'right-hand side evaluations'
  set xrange [rhs_min/1.6:rhs_max*1.6]
  if (narrow) { eval panel(left, left + panel_width, height - bottom - panel_height, height - bottom) } \
  else { eval panel(left + panel_width + 14, width - right, top, top + panel_height) }
  plot for [i = 1:methods] data index i - 1 using 3:column_of_error with linespoints ls i notitle
  unset object 1
  eval finish
}
