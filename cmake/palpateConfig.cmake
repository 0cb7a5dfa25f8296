# find_package(palpate) gives palpate::controllers.
include(CMakeFindDependencyMacro)
find_dependency(Eigen3)
include(${CMAKE_CURRENT_LIST_DIR}/palpateTargets.cmake)
