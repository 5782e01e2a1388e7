// x86-64 with AVX2 and fused multiply-add. CMakeLists.txt gives this file those instructions.
#define IMUSCOPE_LOOPS_SYMBOL kAvx2Loops
#define IMUSCOPE_LOOPS_SET InstructionSet::kAvx2
#define IMUSCOPE_LOOPS_NAME "AVX2"
#define IMUSCOPE_LOOPS_WIDTH 4
#define IMUSCOPE_LOOPS_GROUP 2
#include "estimation/calibration/covariance_loops.inc"
