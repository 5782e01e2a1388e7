// For every processor that the program is built for.
#define IMUSCOPE_LOOPS_SYMBOL kBaselineLoops
#define IMUSCOPE_LOOPS_SET InstructionSet::kBaseline
#define IMUSCOPE_LOOPS_NAME "baseline"
#define IMUSCOPE_LOOPS_WIDTH 2
#define IMUSCOPE_LOOPS_GROUP 2
#include "estimation/calibration/covariance_loops.inc"
