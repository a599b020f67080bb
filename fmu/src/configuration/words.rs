//! Words that a key may have for its value, each written once.

/// An enum whose values a file names by words.
macro_rules! words {
    (
        $(#[$meta:meta])*
        pub enum $Name:ident { $($(#[$of_value:meta])* $Value:ident = $word:literal,)+ }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
        pub enum $Name { $($(#[$of_value])* #[serde(rename = $word)] $Value,)+ }

        impl $Name {
            /// The words, in order.
            pub const WORDS: &[&str] = &[$($word),+];

            /// Its word in a configuration.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$Value => $word),+ }
            }
        }
    };
}

pub(super) use words;
