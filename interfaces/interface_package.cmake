# Builds the interface package of the including folder from its package.xml and its msg/, srv/ and action/ files.

set(CMAKE_C_FLAGS_RELEASE "-O1")
set(CMAKE_CXX_FLAGS_RELEASE "-O1")

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
ament_package_xml()
foreach(dependency ${${PROJECT_NAME}_BUILD_DEPENDS})
  find_package(${dependency} REQUIRED)
endforeach()

# For set-up, generated is what rclpy on rmw_fastrtps_cpp loads: the C messages, their Fast DDS and introspection type
# supports (rmw_fastrtps_cpp describes every type to DDS by the latter) and the Python classes. C++ would double the time.
if(PYTHON_ONLY)
  list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")
endif()

file(GLOB files RELATIVE "${CMAKE_CURRENT_SOURCE_DIR}" msg/*.msg srv/*.srv action/*.action)
rosidl_generate_interfaces(${PROJECT_NAME} ${files} DEPENDENCIES ${${PROJECT_NAME}_BUILD_DEPENDS})
ament_package()

# The Python targets of the PyPI wheels name include folders of the machine they were built on, which CMake refuses.
get_directory_property(targets IMPORTED_TARGETS)
foreach(target ${targets})
  get_target_property(folders ${target} INTERFACE_INCLUDE_DIRECTORIES)
  if(folders MATCHES "/opt/python/")
    list(FILTER folders EXCLUDE REGEX "^/opt/python/")
    set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${folders}")
  endif()
endforeach()
