// x86-64 with AVX-512. CMakeLists.txt gives this file those instructions.
#define IMUSCOPE_LOOPS_SYMBOL kAvx512Loops
#define IMUSCOPE_LOOPS_SET InstructionSet::kAvx512
#define IMUSCOPE_LOOPS_NAME "AVX-512"
#define IMUSCOPE_LOOPS_WIDTH 8
#define IMUSCOPE_LOOPS_GROUP 3
#include "estimation/calibration/covariance_loops.inc"
