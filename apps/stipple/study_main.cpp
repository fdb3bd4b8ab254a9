#include "apps/stipple/common.h"
#include "apps/stipple/program.h"

int main(int argc, char** argv) {
    using namespace stipple;
    return app::runProgram(argc, argv,
                           {[](CLI::App& app, int& status) {
                                app::setupStudy(app, status);
                                app::setupSelfTest(app, status);
                            },
                            {}});
}
