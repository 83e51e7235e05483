/* The table that `pinwheel compare` writes, for its tests. */
#ifndef COMPARE_TABLE_H
#define COMPARE_TABLE_H

/* Columns of compare.csv, from 0. */
enum {
  METHOD,
  LADDER,
  LEVEL,
  STATUS,
  TIME,
  END,
  MOST = END + 4,
  MULTIPLIER = END + 8,
  BELOW,
  ORDER,
  POSITION,
  VELOCITY,
  BALANCE,
  STEPS,
  REJECTED,
  RHS,
  JACOBIANS,
  FACTORISATIONS,
  CPU,
  SPREAD,
  REPEATS,
  REASON
};

/* The cell of a row, from 0, of compare.csv in a folder; no text in quotes comes before it. */
const char *compare_cell (const char *file, int row, int column);
double compare_number (const char *file, int row, int column);

#endif
