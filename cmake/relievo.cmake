# SPDX-License-Identifier: Apache-2.0
# Options and helpers every folder uses.

# Paths below this folder go into ccache's keys relative to it, so that checkouts share what they compile, wherever they lie; a
# header that many include is read once. Not by cmake -E env, which takes longer than what ccache has.
find_program(CCACHE ccache)
if(CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(ccache_here env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 CCACHE_INODECACHE=1 ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${ccache_here})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${ccache_here})
endif()

if(CMAKE_BUILD_TYPE STREQUAL "Release")
  set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")
endif()
find_package(Threads REQUIRED)

add_library(relievo_options INTERFACE)
target_compile_options(relievo_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall;-Wextra;-Wpedantic;-Wshadow;-Wnon-virtual-dtor;-Wold-style-cast;-Wno-missing-field-initializers>)
# g++ 12 sees overlap in `"text" + std::string` where there is none (its bug 105651).
target_compile_options(relievo_options INTERFACE
  $<$<AND:$<COMPILE_LANG_AND_ID:CXX,GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-restrict>)
target_include_directories(relievo_options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_definitions(relievo_options INTERFACE RELIEVO_VERSION="${PROJECT_VERSION}")
if(RELIEVO_SANITIZE)
  # Instrumented code hides from g++ what is initialised; its manual says to expect false warnings.
  target_compile_options(relievo_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wno-maybe-uninitialized>)
  # -O1 -g1 and not -O2 -g: Beast's templates then compile in half the time; line numbers and assertions stay.
  set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1")
  set(CMAKE_C_FLAGS_RELWITHDEBINFO "-O1 -g1")
  add_compile_options(-fsanitize=${RELIEVO_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${RELIEVO_SANITIZE})
  if(RELIEVO_SANITIZE MATCHES "thread")
    # The thread sanitizer does not know fences (g++ says so, an error here); Asio's locks order all it needs.
    add_compile_definitions(BOOST_ASIO_DISABLE_FENCED_BLOCK)
  endif()
endif()
# A front() of nothing and an index beyond the end stop here, which neither sanitizer sees within what is allocated.
if(RELIEVO_FUZZ OR CMAKE_BUILD_TYPE STREQUAL "Debug")
  add_compile_definitions(_GLIBCXX_ASSERTIONS)
endif()
if(RELIEVO_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link,address -fno-omit-frame-pointer)
endif()

# relievo_compile_quickly(): for a folder that puts libraries' templates together (Beast, CLI11, nlohmann_json) and touches no
# memory by hand: what compiles three times as fast under the sanitizers. What the address sanitizer tells as well is
# left to it: null, misplaced and too small objects. To be called before the folder's targets.
macro(relievo_compile_quickly)
  if(RELIEVO_SANITIZE)
    add_compile_options(-O0)
    if(RELIEVO_SANITIZE MATCHES "undefined")
      add_compile_options(-fno-sanitize=null,alignment,object-size,vptr)
    endif()
  endif()
endmacro()

# relievo_library(NAME SOURCES ... LIBS ... PUBLIC_LIBS ...): a static library of one folder.
# LIBS are private to it; PUBLIC_LIBS only for folders whose headers are included by this one's headers.
function(relievo_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBS;PUBLIC_LIBS" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC relievo_options ${arg_PUBLIC_LIBS} PRIVATE ${arg_LIBS})
endfunction()
