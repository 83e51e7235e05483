# include look.gp

# ---- Data and model of each column, below them the residuals ----
# Above: panels (number of columns shown), label[i], weighted (1: the data have standard deviations).  A block of
# fit.dat for each column: t [s], data, standard deviation, model.

title = 'data and fitted model'
left = 58.0 # for the digits of residuals
array lowest[2*panels] # of the data and the model, then of the residuals
array highest[2*panels]
do for [i = 1:panels] {
  stats 'fit.dat' index i - 1 using 2 name 'data' nooutput
  stats 'fit.dat' index i - 1 using 4 name 'model' nooutput
  stats 'fit.dat' index i - 1 using (column(4) - column(2)) name 'residual' nooutput
  stats 'fit.dat' index i - 1 using (weighted ? column(3) : 0) name 'sigma' nooutput
  lowest[i] = min(data_min, model_min) - sigma_max
  highest[i] = max(data_max, model_max) + sigma_max
  lowest[panels + i] = residual_min - sigma_max
  highest[panels + i] = residual_max + sigma_max
  left = margin_of(lowest[i], highest[i], 0)
  left = margin_of(lowest[panels + i], highest[panels + i], 0)
}
gap = left + 6
eval two_columns
panel_height = panel_width*(panel_columns == 1 ? 0.5 : 0.6)
residual_height = max(0.6*panel_height, 66.0)
block_height = panel_height + 8 + residual_height + 40
legend_top = top
top = top + 13
height = top + panel_rows*block_height - 40 + bottom
set style line 1 pt 7 ps 0.35 lw 0.6 lc rgb '#888888'
set style line 2 lw 1.1 lc rgb '#004488'
# Plots y of block i, with bars of the standard deviation if there is one.
bars(i, y) = sprintf('plot "fit.dat" index %d using 1:(%s)%s ls 1 notitle', i - 1, y, \
  weighted ? ':3 with yerrorbars' : ' with points')
do for [form in forms] {
  eval page(form)
  eval begin_legend(2)
  plot NaN with points ls 1 title (weighted ? 'data ± σ' : 'data'), NaN with lines ls 2 title 'model'
  eval end_legend
  set xzeroaxis lt 1 lw 0.5 lc rgb '#999999'
  do for [i = 1:panels] {
    x = left + ((i - 1) % panel_columns)*(panel_width + gap)
    y = top + ((i - 1)/panel_columns)*block_height
    eval panel(x, x + panel_width, y, y + panel_height)
    set format x ''
    set format y '%g'
    set xlabel ''
    set ylabel label[i] noenhanced
    eval range('y', lowest[i], highest[i], 0)
    eval bars(i, 'column(2)').', "" index '.(i - 1).' using 1:4 with lines ls 2 notitle'
    eval panel(x, x + panel_width, y + panel_height + 8, y + panel_height + 8 + residual_height)
    set format x '%g'
    set xlabel 't [s]'
    set ylabel 'residual'
    eval range('y', lowest[panels + i], highest[panels + i], 0)
    eval bars(i, 'column(4) - column(2)')
  }
  eval finish
}
