//! The worked examples of `docs/extending`: each page shows its file here, word for word.

mod fault;
mod reward;

#[test]
fn the_pages_show_what_is_tested() {
    let pages = [
        (include_str!("../../../../docs/extending/fault.md"), include_str!("fault.rs")),
        (include_str!("../../../../docs/extending/reward.md"), include_str!("reward.rs")),
    ];
    for (page, example) in pages {
        assert!(
            page.replace("\r\n", "\n").contains(&format!("```rust\n{}```", example.replace("\r\n", "\n")))
        );
    }
}
