"""The compiled core: what is done with an arm in every cycle, whatever commands the arm; C++ behind a C interface."""
