/* Energy that a hand is given and that was taken from it: forces are made weaker where it would get
 * more than it gave. In three coordinates or six. */
#ifndef EBPO_HAPTIC_PASSIVE_H
#define EBPO_HAPTIC_PASSIVE_H

typedef struct ebpo_passive {
    double stiffness, given, step_most;
} ebpo_passive;

/* The hand has moved against the force of the last tick. */
void ebpo_passive_moved(ebpo_passive *p, const double *force, const double *moved, int n);

/* The force of a spring from the hand along `depth` to the proxy, less `damping` times `moved`, and
 * never against `depth`. */
void ebpo_passive_push(const ebpo_passive *p, double damping, const double *depth,
                       const double *moved, int n, double *force);

#endif
