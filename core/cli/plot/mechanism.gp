
# ---- Snapshots of the motion, coloured by time; paths of the markers; points of the ground ----

title = 'snapshots of the motion'
array style[3] = ['lines lw 1.4 dt 1', 'lines lw 4 dt 1', 'points pt 7 ps 0.5'] # of bodies, wheels, bodies without attachments
array images[2] = ['', '']
do for [i = 1:panels] {
  do for [block in blocks] {
    images[i] = images[i].sprintf(", '%s' index %s using 1:2:3 with %s lc palette", \
      i == 1 ? 'mechanism.dat' : 'mechanism-start.dat', block, style[block + 1])
  }
  do for [block in markers] {
    images[i] = images[i].sprintf(", 'wheels.dat' index %s using 2:3 with lines lw 1.6 dt 1 lc rgb 'black'", block)
  }
  if (ground) { images[i] = images[i].", 'ground.dat' using 1:2 with points pt 9 ps 1.2 lc rgb 'black'" }
}
do for [form in 'svg png'] {
  eval page(form)
  unset key
  set xlabel 'x [m]'
  set ylabel 'y [m]'
  unset xzeroaxis
  set cblabel 't [s]'
  do for [i = 1:panels] {
    eval place(i)
    set cbrange [0:i == 1 ? t_end : t_detail]
    eval sprintf('set colorbox horizontal user origin graph 0,screen %.6f size graph 1,screen %.6f', \
                 1 - (py1[i] + 80)/height, 12.0/height)
    eval 'plot '.images[i][3:*]
  }
  unset multiplot
  unset output
}
