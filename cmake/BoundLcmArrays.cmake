# Run as a script on the C++ headers that lcm-gen wrote: cmake -D headers=DIR -P BoundLcmArrays.cmake
# A decoder made by lcm-gen resizes an array to the length that the message claims before it looks whether so many
# elements can follow: twenty bytes from the network could ask for 16 GB. Here every such resize is preceded by the
# question whether the length is possible at all, as an element takes a byte at least. A string has at least its zero:
# its decoder asked only whether the length is too large, and then took one from the least number there is.
file(GLOB files "${headers}/*.hpp")
foreach(file IN LISTS files)
  file(READ "${file}" text)
  string(REGEX MATCHALL "[.]resize[(]" resizes "${text}")
  string(REGEX MATCHALL "[.]assign[(]" assigns "${text}")
  string(REGEX REPLACE "(this->[A-Za-z0-9_]+[.]resize[(](this->[A-Za-z0-9_]+)[)])"
                       "if (\\2 < 0 || \\2 > maxlen - pos) return -1; \\1" bounded "${text}")
  string(REGEX REPLACE "if[(](__[A-Za-z0-9_]+) > maxlen - pos[)]" "if (\\1 < 1 || \\1 > maxlen - pos)" bounded
                       "${bounded}")
  string(REGEX MATCHALL "< 0 [|][|] this->[A-Za-z0-9_]+ > maxlen - pos" of_arrays "${bounded}")
  string(REGEX MATCHALL "< 1 [|][|] __[A-Za-z0-9_]+ > maxlen - pos" of_strings "${bounded}")
  foreach(pair resizes:of_arrays assigns:of_strings)
    string(REPLACE ":" ";" pair "${pair}")
    list(GET pair 0 uses)
    list(GET pair 1 guards)
    list(LENGTH ${uses} use_count)
    list(LENGTH ${guards} guard_count)
    if(NOT use_count EQUAL guard_count)
      message(FATAL_ERROR "${file}: ${guard_count} of ${use_count} lengths are bounded; lcm-gen writes its decoders "
                          "differently than lcm 1.3 to 1.5 did, and this script is to be adapted")
    endif()
  endforeach()
  file(WRITE "${file}" "${bounded}")
endforeach()
