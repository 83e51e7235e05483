# find_package (pinwheel) defines the target pinwheel::pinwheel, in C and C++: both libraries and the headers, as
# "pinwheel/run.h" or "run.h".  Installed in lib/cmake/pinwheel.
get_filename_component (pinwheel_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if (NOT TARGET pinwheel::pinwheel)
  add_library (pinwheel::pinwheel INTERFACE IMPORTED)
  set_target_properties (pinwheel::pinwheel PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES "${pinwheel_prefix}/include;${pinwheel_prefix}/include/pinwheel"
    INTERFACE_LINK_LIBRARIES "${pinwheel_prefix}/lib/libpinwheel-files.so;${pinwheel_prefix}/lib/libpinwheel.so;m")
endif ()
unset (pinwheel_prefix)
