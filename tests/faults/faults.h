/* Commands of the program called from inside while something fails, and what is to be said of the files they leave.
 *
 * For programs linked with the program's commands.  A command writes into @/o (@ is the folder of cli.h); what it
 * leaves there when nothing fails is kept in @/whole; what is there before it begins, in @/start. */
#ifndef FAULTS_H
#define FAULTS_H

/* A setup: the folder, and programs that the commands ask for, at no cost: gnuplot draws nothing, the compiler has
 * compiled the EzyRoller.  Its teardown is cli_teardown. */
int faults_setup (void);

/* Fills @/start by a shell command, and @/whole by the command itself, which has to succeed. */
void faults_begin (const char *start, const char *command);

/* Makes @/o what it was before the command. */
void faults_prepare (void);

/* Runs a command as far as it gets, with what it prints in @/printed and what it says of errors in @/log; its
 * status. */
int faults_run (const char *command);

/* The first file of @/o that looks whole and is not, or NULL.  A file is whole by what it holds, or if it has as many
 * lines as the one in @/whole: times make others differ. */
const char *faults_broken (void);

#endif
