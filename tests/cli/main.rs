//! The command line as users see it: arguments and files in, exit code, stdout, stderr and files out. Texts
//! that are stable are kept in `golden/`; run with `PUNCTUAL_UPDATE_GOLDEN=1` to rewrite them, and read the
//! difference before committing it.

mod alone;
mod arming;
mod assuring;
mod bad_configurations;
mod bad_fmus;
mod bad_systems;
mod building;
mod campaigns;
mod checking;
mod declared;
mod demonstrating;
mod failing;
mod fmi3;
mod help;
mod hostile;
mod html;
mod identifying;
mod in_process;
mod inspecting;
mod judging;
mod late;
mod merging;
mod misbehaving;
mod missions;
mod mistakes;
mod models;
mod packing;
mod pages;
mod plugins;
mod reproducing;
mod running;
mod sundry;
mod surviving;
mod table;
mod trying;
mod units;
mod validating;
mod vehicles;
mod workshop;
