/* Data of the implicit master; Python fills them, see newton.py. */

#ifndef NEWTON_DATA_H
#define NEWTON_DATA_H

#include "line.h"

/* Further data of each line. */
typedef struct {
    int64_t inner;     /* source and target are in the same loop */
    int64_t unknown;   /* index of the unknown that it reads; -1: its source is stepped before */
    int64_t is_force;  /* it is the force of a contact or an input of one, or has the unit of such a force */
    int64_t carries;   /* bits of the contacts in the loop whose forces reach it through sums */
    int64_t from_rest; /* the run begins with the value 0 */
    int64_t role;      /* in the current solution; see contacts.h */
    double u0, q0;     /* at the start */
    double u1, q1;     /* at the end, in the current iteration */
    double scale;      /* largest magnitude so far */
    double size, lasting,
        at_begin;             /* magnitude without peaks, see forget_peaks; that of the steps before; at the start */
    double outside;           /* of a line from outside of the loop: largest magnitude so far */
    double accumulated_error; /* errors that the guard found and could not remove: root of the sum of their squares */
    double gain, offset;      /* of the connection in this step, if there are manipulators */
    double path, distance_error; /* velocity of a contact: distance so far, and how much of it no step resolved */
    int64_t rests;               /* velocity of a contact: its role at the end of the last step */
    int64_t force;               /* the same: the role of its force */
    double x0, strayed;          /* velocity of a contact: position of the mass at the start; see strayed() */
    double noise;                /* change per time if the unknowns change by the tolerance of the loop */
    int64_t rigid; /* velocity of a contact: 1: the friction jumps at v = 0, -1: it does not, 0: unknown */
    /* velocity of a contact at rest beside others, see contacts.h: the forces between which it holds; the unknown that
       determines its force, or -1; both over this one */
    double low, high;
    int64_t leader, still; /* `still`: it stops at the start of the span */
    int64_t partial;       /* the loads that the contact reads are not all forces on the mass */
    int64_t leaves;        /* it is at rest, but the forces at the start of the span move it */
    double base, slope;
} Moving;

/* A part of a loop that turns a velocity into a force. */
typedef struct {
    int64_t part, line, unknown;    /* the part; line of its velocity; unknown that is its force */
    int64_t first_load, load_count; /* its inputs that are forces, one of which may be the sum of the other forces */
    int64_t of_mass, of_next; /* outputs of the mass whose velocity it reads; none of a part with several masses */
    int64_t position;         /* output whose rate that velocity is; -1: unknown */
    int64_t bit;              /* in Moving.carries; 0: none is left */
} Contact;

/* An output of a loop that depends on no input directly and drives none in the loop, such as the position of a mass.
   The position within a step is the integral of what the forces do, not of the line of the velocity. */
typedef struct {
    int64_t output;
    int64_t unit; /* of those in the loop; 0: that of the force of a contact */
} StateOutput;

typedef struct {
    int64_t first, count; /* its parts, in stepping order */
    int64_t is_loop;
    int64_t line, lines;       /* its first place in Newton.lines and the number of lines to its parts */
    int64_t unknown, unknowns; /* its first unknown and the number of unknowns */
    int64_t held, held_count;  /* its first held input and the number of them */
    int64_t contact, contacts; /* its first contact and the number of them */
    int64_t state, states;     /* its first state and the number of them */
} Group;

/* State of the guard of a loop, see step_check.h. */
typedef struct {
    int64_t line;          /* line with the largest error in the last finding */
    int64_t contact;       /* line of the velocity with the largest error of the distance in it */
    int64_t checks_due;    /* number of undivided steps still to check */
    int64_t cooldown;      /* ticks before the next suspicion counts, after a check without a finding */
    int64_t next;          /* first tick at which a suspicion counts again */
    int64_t last;          /* tick of the last finding */
    int64_t recurrences;   /* number of findings soon after the previous one */
    int64_t limited_ticks; /* ticks for which `limit` remains in force */
    int64_t checks;        /* number of steps checked */
    int64_t abandoned;     /* no step is small enough: checks have ended */
    int64_t resolves; /* PART_OF_STEP, WHOLE_STEP: after the last jump the motion was not over within it; 0: it was */
    int64_t jumped;   /* the solution of the last step lies at a jump of r */
    double miss;      /* largest difference of the last inner step from its prediction, over the magnitude */
    double harmless;  /* the same, of those whose checks found nothing before and during the cooldown */
    double jump;      /* of an input from outside since the last step, over its magnitude */
    double apart;     /* error of that line */
    double distance_error; /* error of the distance along `contact` */
    double limit;          /* [s] longest inner step while findings recur */
    double unresolved;     /* inner steps of the smallest size that were still wrong: sum of their shares of the step */
    double time;           /* [s] of the first of these; until then, of the first disagreement */
} StepCheck;

typedef struct {
    const Group *groups;
    int64_t group_count;
    const int64_t *order;      /* indices of the parts, group by group */
    const int64_t *continuous; /* of each part */
    Moving *moving;
    const int64_t *lines;    /* indices of the lines, group by group */
    const int64_t *unknowns; /* output that each unknown stands for */
    const int64_t *held; /* Real inputs of continuous parts that are not lines, such as the force of a sampled law */
    double *held_values, *held_sizes; /* in the last step; largest magnitudes so far */
    const Contact *contacts;
    const int64_t *loads; /* inputs of contacts that are forces */
    const StateOutput *states;
    double *state_sizes, *kept_states;  /* largest magnitudes so far; values of the whole step during a check */
    double *w, *w_last, *trend;         /* value, value of the last step, slope over the last step */
    double *scale, *lasting, *at_begin; /* magnitude without peaks, as of a line */
    double *prediction_error, *growth;  /* error of the last prediction; how often it changed its sign and grew */
    double *r, *work;                   /* residuals; work space of 7 n + 2 n^2 for n = most_unknowns */
    double *inverse;                    /* inverse of dr/dw, n by n, at n^2 times the index of the group */
    int64_t most_unknowns;              /* largest number of unknowns of a group */
    double tolerance;                   /* tolerance of r over scale */
    double error;                       /* tolerated error of a step over scale; 0: fixed steps */
    double step_tolerance;              /* tolerated difference of a step from its halves over the magnitude */
    double finest;                      /* largest number of inner steps per step, unless convergence needs more */
    double *proposed, *before;          /* [s] next inner step of each group; its last one, or 0 */
    StepCheck *guards;                  /* one for each group */
    Moving *kept_lines;                 /* copies during a check: lines, */
    double *kept;                       /* and w, w_last, trend, scale, inverse Jacobian; values of lines */
    double worst_residual;
    int64_t jumped; /* the last solution lies at a jump of r */
    int64_t splits; /* a step may be divided where a contact breaks away */
    double share;   /* of the step before that */
    int64_t turns;  /* a contact stops at the start of the span and moves the other way */
    int64_t evaluations, substeps, rejected;
} Newton;

#endif
