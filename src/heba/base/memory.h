// A process keeps the memory that it frees, or returns it to the system.
#pragma once

namespace heba {

// Makes the process keep memory that it frees for what it allocates next. Without it, glibc returns large blocks to the
// system each time, which has to fill them with zeros again: a third of the time of a calibration with many unknowns.
// A program calls it once, before it starts threads; a library leaves the choice to its program. Does nothing without
// glibc.
void KeepFreedMemory();

}  // namespace heba
