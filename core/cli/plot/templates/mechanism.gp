# include look.gp
# include plane.gp

# ---- Snapshots of the motion: earlier ones fainter, the last one with symbols; paths of the markers ----

title = 'snapshots of the motion'.(by_time ? '' : ', earlier ones lighter')
array code[8]
do for [i = 1:8] { code[i] = int('0x'.colour(i)[2:7]) }
part(c, unit, f) = int(255 - f*(255 - (c/unit) % 256))*unit
# The colour of a body; the ground and elements are grey.
shade(body, f) = (c = body > 0 ? code[(int(body) - 1) % 8 + 1] : 0x555555, part(c, 65536, f) + part(c, 256, f) + part(c, 1, f))
fade(t, t_end) = 0.22 + 0.4*t/t_end
array images[2] = ['', '']
do for [i = 1:panels] {
  file = i == 1 ? "'mechanism.dat'" : "'mechanism-start.dat'"
  span = i == 1 ? 't_end' : 't_detail'
  before(k, look) = sprintf(", %s index %d using 1:2:%s with %s notitle", file, k, \
    by_time ? '3' : '(shade($4, fade($3, '.span.')))', look.(by_time ? ' lc palette' : ' lc rgb variable'))
  now(k, look) = sprintf(", %s index %d using 1:2:%s with %s notitle", file, k, by_time ? '3' : '(shade($4, 1))', \
    look.(by_time ? ' lc palette' : ' lc rgb variable'))
  images[i] = before(0, 'lines lw 0.7 dt 1').before(3, 'lines lw 0.5 dt 1').before(1, 'lines lw 1.6 dt 1').before(2, 'points pt 7 ps 0.5')
  do for [block in markers] {
    images[i] = images[i].sprintf(", 'wheels.dat' index %s using 2:3 with lines lw 0.9 dt 1 lc rgb 'black' notitle", block)
  }
  if (!by_time) { do for [c in areas] {
    images[i] = images[i].sprintf(", %s index 4 using ($4 > 0 && (int($4) - 1) %% 8 == %d ? $1 : NaN):2 with filledcurves closed fc rgb '%s' fs transparent solid 0.25 noborder notitle", \
      file, c - 1, colour(c + 0))
  }}
  images[i] = images[i].now(4, 'lines lw 1.6 dt 1').now(6, 'points pt 7 ps 0.8')
  images[i] = images[i].sprintf(", %s index 8 using 1:2 with lines lw 0.7 dt 1 lc rgb '#202020' notitle", file)
  images[i] = images[i].sprintf(", %s index 9 using 1:2 with filledcurves closed fc rgb 'white' fs solid noborder notitle", file)
  images[i] = images[i].sprintf(", %s index 9 using 1:2 with lines lw 0.7 dt 1 lc rgb '#202020' notitle", file)
}
names = ''
do for [i = 1:by_time ? 0 : bodies] { names = names.sprintf(", keyentry with lines lw 2 dt 1 lc rgb colour(%d) title short(body[%d])", i, i) }
do for [form in forms] {
  eval page(form)
  set xlabel 'x [m]'
  set ylabel 'y [m]'
  unset xzeroaxis
  if (by_time) { set cblabel 't [s]' } else { unset colorbox }
  do for [i = 1:panels] {
    if (i == 1 && strlen(names)) { eval key(above, per_row) } else { unset key }
    eval place(i)
    set cbrange [0:i == 1 ? t_end : t_detail]
    if (by_time) { eval sprintf('set colorbox horizontal user origin graph 0,screen %.6f size graph 1,screen %.6f', \
                                1 - (py1[i] + 38)/height, 6.0/height) }
    eval 'plot '.(i == 1 && strlen(names) ? names[3:*].images[i] : images[i][3:*])
  }
  unset multiplot
  unset output
}
